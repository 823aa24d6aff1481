// A form made of what a type says of its parameters, checked here as far as the kinds say.

import { make } from "./dom.js";

const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?/i;

/** What is wrong with a text as a value of a parameter, in words, or null. An empty text leaves the parameter as it is. */
export function mistake(parameter, text) {
    const value = text.trim();
    if (value === "") return null;
    switch (parameter.kind) {
        case "number":
            return quantity(parameter, value);
        case "integer":
            return /^[+-]?\d+$/.test(value) ? outside(parameter, Number(value)) : "a whole number, please";
        case "flag":
            return ["true", "false"].includes(value) ? null : "true or false";
        case "point":
        case "size": {
            const parts = value.split(";");
            if (parts.length !== 3) return "three numbers, please, as in 1; 2; 0.5";
            return (
                parts.map(part => quantity({ ...parameter, min: null, max: null }, part.trim())).find(Boolean) ?? null
            );
        }
        case "choice":
            return (parameter.choices ?? [value]).includes(value) ? null : `one of ${parameter.choices.join(", ")}`;
        default:
            return null;
    }
}

/** A number, with or without a unit: `10`, `10 m`, `-120 deg`. One in another unit is left to the server to convert. */
function quantity(parameter, value) {
    const digits = NUMBER.exec(value)?.[0];
    if (digits === undefined) return "a number, please";
    const unit = value.slice(digits.length).trim();
    if (unit !== "" && !parameter.unit) return `a number without a unit, please, not in ${unit}`;
    return unit === "" || unit === parameter.unit ? outside(parameter, Number(digits)) : null;
}

function outside({ min, max, unit }, number) {
    const words = limit => `${limit}${unit ? ` ${unit}` : ""}`;
    if (min !== null && min !== undefined && number < min) return `at least ${words(min)}`;
    if (max !== null && max !== undefined && number > max) return `at most ${words(max)}`;
    return null;
}

/** A field a parameter; `values()` gives what was filled in as `[name, text]`, or null after showing what is wrong. */
export function parameterFields(parameters) {
    const fields = parameters.map(field);
    return {
        elements: fields.map(({ element }) => element),
        values() {
            const wrong = fields.filter(field => !field.check());
            wrong[0]?.input.focus();
            if (wrong.length > 0) return null;
            return fields
                .filter(({ input }) => input.value.trim() !== "")
                .map(({ parameter, input }) => [parameter.name, input.value.trim()]);
        },
    };
}

let numberOfFields = 0;

/** What a parameter is of which nothing is said: what was said of it before. */
function unsaid(parameter) {
    return parameter.default ? `as it is (by default ${parameter.default})` : "as it is";
}

function field(parameter) {
    const id = `parameter-${++numberOfFields}`;
    const kind = [parameter.kind, parameter.unit && `in ${parameter.unit}`].filter(Boolean).join(" ");
    const input =
        parameter.kind === "flag" || parameter.choices
            ? choice(parameter)
            : make("input", {
                  type: "text",
                  placeholder: unsaid(parameter),
                  autocomplete: "off",
                  spellcheck: false,
                  inputMode: ["number", "integer"].includes(parameter.kind) ? "decimal" : "text",
              });
    Object.assign(input, { id });
    input.setAttribute("aria-describedby", `${id}-summary ${id}-error`);
    const error = make("p", { id: `${id}-error`, class: "error", hidden: true });
    const check = () => {
        const wrong = mistake(parameter, input.value);
        Object.assign(error, { hidden: wrong === null, textContent: wrong ?? "" });
        input.setAttribute("aria-invalid", wrong !== null);
        return wrong === null;
    };
    input.addEventListener("change", check);
    const label = make("label", { htmlFor: id }, parameter.name, " ", make("small", { textContent: kind }));
    const summary = make("p", { id: `${id}-summary`, textContent: parameter.summary ?? "" });
    return { parameter, input, check, element: make("div", { class: "parameter" }, label, input, error, summary) };
}

function choice(parameter) {
    const words = parameter.kind === "flag" ? ["true", "false"] : parameter.choices;
    return make("select", {}, make("option", { value: "", textContent: unsaid(parameter) }), ...words.map(word => make("option", { value: word, textContent: word })));
}
