// What apps draw, and the keys that they take, on the page in a real browser.
//
//     node --test tests/view/drawings.test.mjs

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { test } from "node:test";
import { fileURLToPath } from "node:url";

import { readBinary } from "../../apps/view/page/binary.js";
import { drawingMessage } from "./building.mjs";
import { PLAN, SCENE, clickText, heard, pageTest } from "./harness.mjs";

const KEYS_RS = fileURLToPath(new URL("../../bus/drawing/src/keys.rs", import.meta.url));
const PINK = [255, 0, 255, 255];
const GREEN = [0, 255, 0, 255];

/** Primitives that cover the place [0, 0, 1] as seen from anywhere above. */
const PRIMITIVES = {
    points: { kind: "points", at: [[0, 0, 1]], colours: [PINK], size: 40 },
    "a line list": {
        kind: "lines",
        at: [[-1, 0, 1], [1, 0, 1], [-1, 1, 1], [1, 1, 1]],
        colours: [PINK, PINK, GREEN, GREEN],
        width: 20,
        joined: false,
    },
    "a line strip": {
        kind: "lines",
        at: [[-1, -1, 1], [-0.5, 0, 1], [1, 0, 1]],
        colours: [GREEN, PINK, PINK],
        width: 20,
        joined: true,
    },
    triangles: { kind: "triangles", at: [[-1, -1, 1], [1, -1, 1], [0, 2, 1]], colours: [PINK] },
    voxels: { kind: "voxels", at: [[0, 0, 0.5], [3, 3, 0.5]], colours: [PINK, GREEN], edge: 1 },
    text: { kind: "text", at: [[0, 0, 1]], colours: [PINK], text: "████", size: 30 },
    "an image": {
        kind: "image",
        at: [[-1, -1, 1], [2, 0, 0], [0, 2, 0]],
        colours: [GREEN, PINK, GREEN, GREEN, PINK, GREEN],
        columns: 3,
    },
};

const shown = (drawings, app = "painter") => [
    { type: "drawings", rows: drawings.map(([name]) => ({ app, name })) },
    ...drawings.map(([name, primitives, frame]) => drawingMessage(app, name, primitives, frame)),
];

function send(mock, messages) {
    for (const message of messages) mock.send(message);
}

/** Hides all else, and looks down at a place (m). */
async function lookAt(page, place, pitch = 1.2) {
    await page.until("!elk.stage.scene || elk.stage.scene.chunks.waiting === 0");
    await page.eval(`(() => {
        for (const layer of [...elk.world.shown]) elk.world.show(layer, layer === "drawings");
        elk.world.robot = null;
        elk.stage.camera.move({ target: ${JSON.stringify(place)}, distance: 8, pitch: ${pitch}, follows: false });
    })()`);
}

/** The pixel in the middle of a picture, as [r, g, b]. */
const middle = (page, picture) =>
    page.eval(`(() => {
        const { data, width, height } = ${picture};
        const at = 4 * ((height >> 1) * width + (width >> 1));
        return [...data.slice(at, at + 3)];
    })()`);

/** Whether a colour is pink, in whatever light. */
const isPink = ([red, green, blue]) => red > 120 && blue > 120 && green < 0.2 * red;
const drawings = page => page.eval("elk.world.drawings.list().map(({ app, name }) => `${app}/${name}`)");

for (const [name, primitive] of Object.entries(PRIMITIVES)) {
    pageTest(`of the primitives, ${name}: drawn in 3-D and from above`, {}, async ({ page, mock }) => {
        await lookAt(page, [0, 0, 1]);
        assert(!isPink(await middle(page, SCENE)));
        send(mock, shown([["it", [primitive]]]));
        await page.until("elk.world.drawings.list().length === 1");
        const pixel = await middle(page, SCENE);
        assert(isPink(pixel), `${pixel} in 3-D`);
        assert.equal(await page.eval("elk.stage.scene.gl.getError()"), 0);
        await page.eval("elk.stage.showFlat(true)");
        const fromAbove = await middle(page, PLAN);
        assert(isPink(fromAbove), `${fromAbove} from above`);
        // Switched off, and on again.
        await page.eval("elk.world.show('drawings', false)");
        assert(!isPink(await middle(page, SCENE)) && !isPink(await middle(page, PLAN)));
    });
}

pageTest("each place of a primitive has its own colour, if it is said", {}, async ({ page, mock }) => {
    await lookAt(page, [0, 1, 1]);
    send(mock, shown([["lines", [PRIMITIVES["a line list"]]]]));
    await page.until("elk.world.drawings.list().length === 1");
    const [red, green] = await middle(page, SCENE);
    assert(green > 200 && red < 50, "the second line of the list is green");
    await lookAt(page, [3, 3, 1]);
    send(mock, shown([["voxels", [PRIMITIVES.voxels]]]));
    await page.until("elk.world.drawings.list()[0].name === 'voxels'");
    const cube = await middle(page, SCENE);
    assert(cube[1] > 120 && cube[0] < 50, `the second cube is green, not ${cube}`);
});

pageTest("what is drawn on the robot moves with it", {}, async ({ page, mock }) => {
    await lookAt(page, [5, 2, 1]);
    send(mock, shown([["nose", [{ kind: "points", at: [[2, 0, 0]], colours: [PINK], size: 40 }], "robot"]]));
    await page.until("elk.world.drawings.list().length === 1");
    assert(!isPink(await middle(page, SCENE)), "nobody knows where the robot is");
    // A quarter turn to the left: what is ahead of it is along y.
    const half = Math.SQRT1_2;
    mock.send({ type: "robot", position: [5, 0, 1], quaternion: [0, 0, half, half] });
    await page.until("elk.world.robot !== null");
    assert(isPink(await middle(page, SCENE)));
    assert(isPink(await middle(page, PLAN)));
    mock.send({ type: "robot", position: [9, 0, 1], quaternion: [0, 0, half, half] });
    await page.until("elk.world.robot.position[0] === 9");
    assert(!isPink(await middle(page, SCENE)));
});

pageTest("drawings are listed by app and name, and switched", {}, async ({ page, mock }) => {
    await lookAt(page, [0, 0, 1]);
    const { points, triangles } = PRIMITIVES;
    const others = drawingMessage("other", "c", [{ ...points, at: [[50, 0, 1]] }]);
    const rows = [["painter", "a"], ["painter", "b"], ["other", "c"]].map(([app, name]) => ({ app, name }));
    assert(await page.eval("document.querySelector('#drawings').hidden"));
    send(mock, [{ type: "drawings", rows }, ...shown([["a", [points]], ["b", [triangles]]]).slice(1), others]);
    await page.until("elk.world.drawings.list().length === 3");
    const labels = () => page.eval("[...document.querySelectorAll('#drawings label')].map(at => at.textContent)");
    assert.deepEqual(await labels(), ["other", "c", "painter", "a", "b"]);
    const press = name => clickText(page, "#drawings label", name);
    await press("a");
    assert(isPink(await middle(page, SCENE)), "b is there still");
    assert(await page.eval("document.querySelectorAll('#drawings input')[2].indeterminate"));
    await press("b");
    assert(!isPink(await middle(page, SCENE)));
    // What is drawn anew stays switched off.
    send(mock, shown([["a", [triangles]], ["b", [points]]]));
    await page.until("elk.world.drawings.list().length === 2");
    assert(!isPink(await middle(page, SCENE)));
    await press("painter");
    assert(isPink(await middle(page, SCENE)), "all of an app at once");
    await press("painter");
    assert(!isPink(await middle(page, SCENE)));
    send(mock, [{ type: "drawings", rows: [] }]);
    await page.until("document.querySelector('#drawings').hidden");
    assert.deepEqual(await drawings(page), []);
});

pageTest("a drawing takes the place of the one before, and its vertices leave the card", {}, async ({ page, mock }) => {
    await lookAt(page, [0, 0, 1]);
    for (const colour of [GREEN, PINK]) send(mock, shown([["it", [{ ...PRIMITIVES.points, colours: [colour] }]]]));
    await page.until("elk.world.drawings.list()[0]?.primitives[0].colours[0] === 255");
    assert(isPink(await middle(page, SCENE)));
    const before = await page.eval(`(() => {
        window.freed = 0;
        const { gl } = elk.stage.scene, free = gl.deleteBuffer.bind(gl);
        gl.deleteBuffer = buffer => (window.freed++, free(buffer));
        return elk.world.drawings.list().length;
    })()`);
    assert.equal(before, 1);
    send(mock, [{ type: "drawings", rows: [] }]);
    await page.until("elk.world.drawings.list().length === 0");
    assert(!isPink(await middle(page, SCENE)));
    assert.equal(await page.eval("window.freed"), 1);
});

pageTest("a page that is told to forget forgets drawings and keys", {}, async ({ page, mock }) => {
    mock.send({ type: "keys", rows: [{ app: "geiger", key: "g", meaning: "more" }] });
    send(mock, shown([["it", [PRIMITIVES.points]]]));
    await page.until("elk.world.drawings.list().length === 1 && elk.appKeys.rows.length === 1");
    mock.send({ type: "reset" });
    await page.until("elk.world.drawings.list().length === 0 && elk.appKeys.rows.length === 0");
});

pageTest("whoever hides drawings is not sent any", {}, async ({ page, mock }) => {
    await page.press("9");
    const said = await heard(mock, ({ type, layers }) => type === "show" && !layers.includes("drawings"));
    assert.deepEqual(said.layers, ["scan"]);
});

const ROWS = [
    { app: "geiger", key: "g", meaning: "ten times as much" },
    { app: "geiger", key: "Home", meaning: "as at first" },
    { app: "late", key: "g", meaning: "go", taken_by: "geiger" },
    { app: "late", key: "v", meaning: "a vault", taken_by: "the view" },
];
const presses = mock => mock.received.filter(({ type }) => type === "press").map(({ id, ...rest }) => rest);

pageTest("a key that an app has declared goes to it, with its modifiers", {}, async ({ page, mock }) => {
    await page.press("g");
    mock.send({ type: "keys", rows: ROWS });
    await page.until("elk.appKeys.rows.length === 4");
    await page.press("g");
    await page.press("G", 8);
    await page.press("Home", 1);
    // What is the view's own is done by the view, and what is the browser's by the browser.
    await page.press("v");
    await page.press("g", 2);
    await heard(mock, ({ type, key }) => type === "press" && key === "Home");
    const press = (key, shift, alt) => ({ type: "press", app: "geiger", key, shift, alt });
    assert.deepEqual(presses(mock), [press("g", false, false), press("g", true, false), press("Home", false, true)]);
    assert.equal(await page.eval("elk.stage.isFlat"), true);
    // Nothing is pressed while somebody writes.
    await page.press("/");
    await page.press("g");
    assert.equal(await page.until("document.activeElement.value"), "g");
    assert.equal(presses(mock).length, 3);
    assert.equal(await page.eval("document.querySelector('#toasts').textContent.includes('is told')"), false);
});

pageTest("keys of apps are in the help, can be pressed there, and a conflict is said", {}, async ({ page, mock }) => {
    mock.send({ type: "keys", rows: ROWS });
    await page.until(
        "/late cannot have the key g \\(go\\): geiger has declared it already/.test(document.querySelector('#toasts').textContent)",
    );
    await page.press("?");
    assert.equal(await page.eval("document.activeElement.textContent"), "Close", "no key of an app has the focus");
    const words = await page.eval("document.querySelector('#app-keys').textContent");
    assert.match(words, /ggeiger: ten times as much/);
    assert.match(words, /vlate cannot have the key v \(a vault\): the view has declared it already/);
    const able = "[...document.querySelectorAll('#app-keys button')].map(({ disabled }) => !disabled)";
    assert.deepEqual(await page.eval(able), [true, true, false, false]);
    await clickText(page, "#app-keys button", "Home");
    assert.equal((await heard(mock, ({ type }) => type === "press")).key, "Home");
    // A declaration that is taken back leaves the help, also while it is open.
    mock.send({ type: "keys", rows: [] });
    await page.until("document.querySelector('#app-keys').children.length === 0");
});

pageTest("who may only read has no keys of apps", { readOnly: true }, async ({ page, mock }) => {
    mock.send({ type: "keys", rows: ROWS });
    await page.until("elk.appKeys.rows.length === 4");
    await page.press("?");
    assert(await page.eval("[...document.querySelectorAll('#app-keys button')].every(({ disabled }) => disabled)"));
});

pageTest("the view's own keys are those that apps are told they cannot have", {}, async ({ page }) => {
    const source = await readFile(KEYS_RS, "utf8");
    const list = source.match(/VIEWS_OWN: &\[&str\] = &\[([^;]*)\];/)[1];
    const own = [...list.matchAll(/"((?:[^"\\]|\\.)*)"/g)].map(([, key]) => JSON.parse(`"${key}"`));
    assert(own.length > 20);
    for (const key of await page.eval("elk.keys")) assert(own.includes(key), `the view takes ${key}`);
});

test("a drawing that is cut, or none, is no message", () => {
    const whole = drawingMessage("painter", "it", [PRIMITIVES.triangles, PRIMITIVES["an image"]]);
    const read = bytes => readBinary(Uint8Array.from(bytes).buffer);
    const drawing = read(whole);
    assert.deepEqual([drawing.app, drawing.name, drawing.primitives.length], ["painter", "it", 2]);
    assert.deepEqual([...drawing.primitives[0].at.slice(6)], [0, 2, 1]);
    for (let length = 1; length < whole.length; length++) assert.throws(() => read(whole.subarray(0, length)));
    assert.throws(() => read(Buffer.concat([whole, Buffer.alloc(4)])), /after painter's drawing it/);
    for (const wrong of [{ kind: "spiral" }, { ...PRIMITIVES.points, size: -1 }, { ...PRIMITIVES.text, at: [] }])
        assert.throws(() => read(drawingMessage("a", "b", [{ at: [], colours: [], ...wrong }])), /is none/);
});
