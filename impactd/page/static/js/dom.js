// Elements in one line each: h("p", { class: "soft" }, "text", child).

const PROPERTIES = new Set(["value", "checked", "disabled", "hidden", "selected", "textContent"]);

/** Return an element. `on` holds listeners, `data` data attributes; null children are left out. */
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name === "on") {
      for (const [event, listener] of Object.entries(value)) element.addEventListener(event, listener);
    } else if (name === "data") {
      Object.assign(element.dataset, value);
    } else if (PROPERTIES.has(name)) {
      element[name] = value;
    } else {
      element.setAttribute(name, value === true ? "" : value);
    }
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

/** Return a sentence with what stands in backticks as code: commands, as the daemon writes them. */
export const withCode = (sentence) => sentence.split("`").map((part, at) => (at % 2 ? h("code", {}, part) : part));

/** Replace what an element holds. */
export function fill(element, ...children) {
  element.replaceChildren(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

export const byId = (id) => document.getElementById(id);

/** Say something to a screen reader, without moving anything. */
export function say(sentence) {
  const place = byId("said");
  place.textContent = "";
  // A region that is emptied and filled in one go stays silent.
  setTimeout(() => { place.textContent = sentence; }, 50);
}

/** Return a random key: a request that is repeated with it does nothing twice. */
export function freshKey() {
  if (crypto.randomUUID) return crypto.randomUUID();
  // Plain HTTP from another machine: no secure context, and so no randomUUID.
  return Array.from(crypto.getRandomValues(new Uint8Array(16)), (one) => one.toString(16).padStart(2, "0")).join("");
}
