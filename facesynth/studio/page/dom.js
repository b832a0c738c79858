// Making elements without markup in strings.

/** An element with properties (on… are listeners, aria-… and data-… attributes) and children. */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name.includes("-") || name === "role" || name === "colspan" || name === "scope") element.setAttribute(name, value);
    else element[name] = value;
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

export const labelled = (text, field) => make("label", {}, `${text} `, field);

export function choice(options, value, properties = {}) {
  const list = options.map((option) => (Array.isArray(option) ? option : [option, option]));
  const select = make("select", properties, ...list.map(([key, text]) => new Option(text, key)));
  select.value = value ?? "";
  return select;
}

/** Put children in place, and the focus back on what has the same id. */
export function refill(parent, ...children) {
  const focused = parent.contains(document.activeElement) ? document.activeElement.id : "";
  parent.replaceChildren(...children);
  if (focused) document.getElementById(focused)?.focus();
}
