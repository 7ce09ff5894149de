"use strict";
// Small helpers: elements, texts that change only when they differ, lists that keep their elements.

const byId = (id) => document.getElementById(id);

/** An element with attributes and children. */
function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "class") element.className = value;
    else if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value != null) element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child != null));
  return element;
}

/** Sets a text only when it differs, so that readers and selections are left alone. */
function setText(element, text) {
  const next = text ?? "";
  if (element.textContent !== next) element.textContent = next;
}

function setAttribute(element, name, value) {
  if (value == null || value === false) element.removeAttribute(name);
  else if (element.getAttribute(name) !== String(value)) element.setAttribute(name, value);
}

function setClass(element, name) {
  if (element.className !== name) element.className = name;
}

function setStyle(element, name, value) {
  if (element.style.getPropertyValue(name) !== value) element.style.setProperty(name, value);
}

/** Makes the children of `parent` show `items`; an item keeps its element, and so its focus. */
function keyed(parent, items, key, make, update) {
  const known = parent.elementsByKey ?? new Map();
  const next = new Map();
  let before = parent.firstElementChild;
  for (const item of items) {
    const id = String(key(item));
    const element = known.get(id) ?? make(item);
    next.set(id, element);
    update(element, item);
    if (element === before) before = before.nextElementSibling;
    else parent.insertBefore(element, before);
  }
  for (const [id, element] of known) if (next.get(id) !== element) element.remove();
  parent.elementsByKey = next;
}

/** A share of a bar as CSS. */
const share = (percent) => `${Math.min(100, Math.max(0, percent)).toFixed(2)}%`;

/** The parts of an element made by `make`, found by their `data-part`. */
function part(element, name) {
  element.parts ??= Object.fromEntries([...element.querySelectorAll("[data-part]")].map((p) => [p.dataset.part, p]));
  return element.parts[name];
}

/** A text that may be broken between its words, but not at the hyphens of ids. */
const whole = (text) => text.split(" ").flatMap((word, n) => [...(n > 0 ? [" "] : []), h("span", { class: "whole" }, word)]);

/** Hour and minute of an instant, UTC; and with seconds. */
const clockText = (ms) => new Date(ms).toISOString().slice(11, 16);
const secondsText = (ms) => new Date(ms).toISOString().slice(11, 19);
