// @ts-check
import { h } from "../dom.js";

/** @param {HTMLElement} element */
export function mount(element) {
  element.append(h("h1", {}, "Drive"), h("p", {}, "This view is being built."));
  return {};
}
