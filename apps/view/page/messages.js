// What the server's text messages look like: one row a type, so that nobody behind the link has to check again.

// A shape is a function that throws when the value at `where` is not of it.
const fail = (where, wanted) => {
    throw new Error(`${where} should be ${wanted}`);
};
const is = (test, wanted) => (value, where) => {
    if (!test(value)) fail(where, wanted);
};
const number = is(Number.isFinite, "a number");
const index = is(value => Number.isSafeInteger(value) && value >= 0, "a whole number from 0");
const text = is(value => typeof value === "string", "a text");
const flag = is(value => typeof value === "boolean", "true or false");
const object = is(value => value !== null && typeof value === "object" && !Array.isArray(value), "an object");
const anything = () => {};
const optional = shape => (value, where) => {
    if (value !== null && value !== undefined) shape(value, where);
};
const list = shape => (value, where) => {
    if (!Array.isArray(value)) fail(where, "a list");
    value.forEach((item, i) => shape(item, `${where}[${i}]`));
};
const numbers = length => (value, where) => {
    if (!Array.isArray(value) || value.length !== length || !value.every(Number.isFinite)) {
        fail(where, `${length} numbers`);
    }
};
const record = shapes => (value, where) => {
    object(value, where);
    for (const [name, shape] of Object.entries(shapes)) shape(value[name], `${where}.${name}`);
};
const point = numbers(3);

const app = record({
    name: text,
    element: optional(text),
    type: optional(text),
    pid: optional(number),
    state: text,
    state_secs: optional(number),
    cpu_percent_now: optional(number),
    resident_bytes: optional(number),
    dropped: optional(number),
    rejected: optional(number),
    restarts: optional(number),
    swaps: optional(number),
    last_exit: optional(text),
});
const variable = record({
    key: text,
    type: optional(text),
    writer: optional(text),
    age: optional(number),
    rate: optional(number),
    bytes: optional(number),
    count: optional(number),
    readers: optional(number),
});
const parameter = record({
    name: text,
    kind: text,
    default: optional(text),
    unit: optional(text),
    summary: optional(text),
    choices: optional(list(text)),
    min: optional(number),
    max: optional(number),
});
const appType = record({ name: text, summary: optional(text), params: list(parameter) });

const SHAPES = {
    hello: record({
        version: index,
        live: optional(record({ community: text })),
        recorded: optional(record({ log: text, start: number, end: number })),
        read_only: flag,
        mission: optional(text),
        resolution: optional(number),
    }),
    status: record({ connected: flag, text }),
    damage: record({ text }),
    reset: object,
    robot: record({
        position: point,
        quaternion: numbers(4),
        time: optional(number),
        camera: optional(record({ horizontal: number, vertical: number, range: optional(number) })),
    }),
    way: record({ from: index, points: list(point) }),
    plan: record({ points: list(point), target: optional(point) }),
    progress: record({
        scans: optional(number),
        way: optional(number),
        known: optional(number),
        frontier: optional(number),
        phase: optional(text),
        time: optional(number),
    }),
    curve: record({ name: text, from: index, points: list(numbers(2)) }),
    apps: record({ rows: list(app) }),
    variables: record({ rows: list(variable), left_out: optional(index) }),
    value: record({ key: text, time: optional(number), source: optional(text), kind: text, value: anything, text }),
    log: record({ app: text, from: index, lines: list(text) }),
    event: record({ time: optional(number), text }),
    end: record({ summary: object }),
    types: record({ id: index, elements: list(record({ element: text, types: list(appType) })) }),
    answer: record({ id: optional(index), ok: optional(flag), text }),
    timeline: record({ start: number, end: number, at: number, playing: flag, rate: number, looping: flag }),
    drawings: record({ rows: list(record({ app: text, name: text })) }),
    keys: record({ rows: list(record({ app: text, key: text, meaning: text, taken_by: optional(text) })) }),
    world: record({ ok: flag, text }),
    frame: record({ number: index }),
};

/** The version of the protocol that this page speaks. */
export const VERSION = 1;

/** The message, if it is of a type that this page knows, or null; throws if it is not what its type says. */
export function check(message) {
    record({ type: text })(message, "the message");
    if (!Object.hasOwn(SHAPES, message.type)) return null;
    SHAPES[message.type](message, message.type);
    return message;
}
