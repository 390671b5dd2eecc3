// @ts-check
import { h } from "../dom.js";

/** @param {HTMLElement} element */
export function mount(element) {
  element.append(h("h1", {}, "Models and training"), h("p", {}, "This view is being built."));
  return {};
}
