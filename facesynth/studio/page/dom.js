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

/** Properties of a field whose value is nowhere but in it until a button is pressed; `value` is what it begins with. */
export const draft = (value) => ({ "data-draft": String(value) });

export const labelled = (text, field) => make("label", {}, `${text} `, field);

export function choice(options, value, properties = {}) {
  const list = options.map((option) => (Array.isArray(option) ? option : [option, option]));
  const select = make("select", properties, ...list.map(([key, text]) => new Option(text, key)));
  select.value = value ?? "";
  return select;
}

/** Put children in place: the focus goes back to what has the same id, and what a person put into a `draft` stays. */
export function refill(parent, ...children) {
  const focused = parent.contains(document.activeElement) ? document.activeElement.id : "";
  const drafts = [...parent.querySelectorAll("[data-draft]")].filter((field) => field.value !== field.dataset.draft).map((field) => [field.id, field.value]);
  parent.replaceChildren(...children);
  for (const [id, value] of drafts) keep(document.getElementById(id), value);
  if (focused) document.getElementById(focused)?.focus();
}

function keep(field, value) {
  if (field && (field.tagName !== "SELECT" || [...field.options].some((option) => option.value === value))) field.value = value;
}
