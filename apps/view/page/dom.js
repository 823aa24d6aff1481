// Elements made and kept up to date in a line each, and numbers as people read them.

/** An element with properties (`class`, `on…` and attributes by their names) and children. */
export function make(tag, properties = {}, ...children) {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(properties)) {
        if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
        else if (name in element && name !== "list" && name !== "form") element[name] = value;
        else element.setAttribute(name, value);
    }
    element.append(...children);
    return element;
}

/** Sets a text, if it is another: so a selection in it lives on. */
export function say(element, text) {
    if (element.textContent !== text) element.textContent = text;
}

/**
 * Makes `parent` have one child an item, in their order; of items with the same key the first counts. An item's child stays
 * the same from call to call, with the focus that it may have. `make(item)` returns it, `update(element, item)` shows it.
 */
export function keep(parent, items, keyOf, make, update) {
    const old = parent.kept ?? new Map();
    const kept = new Map();
    let next = parent.firstElementChild;
    for (const item of items) {
        const key = keyOf(item);
        if (kept.has(key)) continue;
        const element = old.get(key) ?? make(item);
        old.delete(key);
        kept.set(key, element);
        update(element, item);
        if (element === next) next = next.nextElementSibling;
        else parent.insertBefore(element, next);
    }
    for (const element of old.values()) element.remove();
    parent.kept = kept;
}

/** Gives what does `action` before the next picture is shown, once, however often it is called until then. */
export function oncePerFrame(action) {
    let asked = false;
    return () => {
        if (!asked)
            requestAnimationFrame(() => {
                asked = false;
                action();
            });
        asked = true;
    };
}

const NOT_KNOWN = "–";
const known = format => value => (value === null || value === undefined ? NOT_KNOWN : format(value));

export const integer = known(value => Math.round(value).toLocaleString("en").replaceAll(",", "\u202f"));
export const metres = known(value => `${value.toFixed(Math.abs(value) < 100 ? 2 : 1)} m`);
export const percent = known(value => `${value.toFixed(value < 10 ? 1 : 0)} %`);
export const perSecond = known(value => `${value.toPrecision(value < 100 ? 2 : 3)} /s`);
export const bytes = known(value => {
    if (value < 1e3) return `${value} B`;
    const unit = value < 1e6 ? ["kB", 1e3] : value < 1e9 ? ["MB", 1e6] : ["GB", 1e9];
    return `${(value / unit[1]).toFixed(value < 10 * unit[1] ? 1 : 0)} ${unit[0]}`;
});
/** A length of time (s): `0.3 s`, `12 s`, `3:07`, `1:02:03`. */
export const duration = known(value => {
    if (value < 60) return `${value.toFixed(value < 10 ? 1 : 0)} s`;
    const [hours, minutes, seconds] = [value / 3600, (value / 60) % 60, value % 60].map(Math.floor);
    const two = part => String(part).padStart(2, "0");
    return hours > 0 ? `${hours}:${two(minutes)}:${two(seconds)}` : `${minutes}:${two(seconds)}`;
});
/** Any number, to some four digits. */
export const figure = known(value => {
    if (Number.isInteger(value) && Math.abs(value) < 1e15) return integer(value);
    const size = Math.abs(value);
    return size >= 1e6 || size < 1e-3 ? value.toExponential(2) : value.toPrecision(4).replace(/\.?0+$/, "");
});
