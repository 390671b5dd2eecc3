// @ts-check
// Elements from code. Text is always text: nothing that the service or an address says becomes markup.

/**
 * An element.
 * @param {string} tag  `p`, or with classes `p.notice.bad`
 * @param {Record<string, any>} [attributes]  functions are listeners; null, undefined and false are left out
 * @param {...(Node | string | number | null | undefined | false)} children
 * @returns {any}
 */
export function h(tag, attributes = {}, ...children) {
  const [name, ...classes] = tag.split(".");
  const element = document.createElement(name);
  if (classes.length) element.className = classes.join(" ");
  for (const [key, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(key, value);
    else if (value === true) element.setAttribute(key, "");
    else if (value !== null && value !== undefined && value !== false) element.setAttribute(key, String(value));
  }
  element.append(...children.filter((each) => each !== null && each !== undefined && each !== false).map((each) =>
    each instanceof Node ? each : String(each)));
  return element;
}

/** In place of what an element has. @param {Element} element @param {...any} children */
export function fill(element, ...children) {
  element.replaceChildren(...children.filter((each) => each !== null && each !== undefined && each !== false));
}

/** Say something to who does not see the page. @param {string} text */
export function say(text) {
  const live = document.getElementById("live");
  if (live && live.textContent !== text) live.textContent = text;
}

/**
 * Calls `act` once nothing has called for it for a while.
 * @param {number} wait_ms
 * @param {() => void} act
 */
export function later(wait_ms, act) {
  let timer = 0;
  return {
    call() {
      clearTimeout(timer);
      timer = setTimeout(act, wait_ms);
    },
    cancel: () => clearTimeout(timer),
  };
}

/**
 * A number as people read it. Only for what is shown: questions carry the number itself.
 * @param {number | null | undefined} value
 * @param {number} [decimals]
 */
export function shown(value, decimals = 2) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = value.toFixed(decimals);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

/**
 * A number as `<data>`: rounded for people, whole in `value`.
 * @param {string} name  as in the answer
 * @param {number | null} value
 * @param {number} decimals
 * @param {string} unit
 */
export function datum(name, value, decimals, unit = "") {
  const text = shown(value, decimals);
  return h("data", { value: value ?? "", "data-name": name }, unit && value !== null ? `${text} ${unit}` : text);
}

/** A share of one as per cent; never a rounded 100 or 0. @param {number} share */
export function percent(share) {
  if (share > 0.99 && share < 1) return share >= 0.995 ? "> 99 %" : "99 %";
  if (share < 0.01 && share > 0) return "< 1 %";
  return `${Math.round(share * 100)} %`;
}
