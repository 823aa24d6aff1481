// What apps draw: which drawings there are, which of them a person wants to see, and the list in which that is said.

import { keep, make, say } from "./dom.js";
import { add, rotate } from "./vectors.js";

const by = id => document.getElementById(id);

/** A drawing's title: whose it is, and its name, which has no slash. */
const title = ({ app, name }) => `${app}/${name}`;

export class Drawings {
    /** By title. */
    #all = new Map();
    /** Titles that a person has switched off; they stay so when a drawing is drawn anew. */
    #hidden = new Set();

    /** A drawing takes the place of the one before of its title. */
    take(drawing) {
        this.#all.set(title(drawing), drawing);
    }

    /** All that are not in the list are gone. */
    keepListed(rows) {
        const listed = new Set(rows.map(title));
        for (const one of this.#all.keys()) if (!listed.has(one)) this.#all.delete(one);
    }

    clear() {
        this.#all.clear();
    }

    /** All, by app and name. */
    list() {
        return [...this.#all.entries()].sort(([a], [b]) => (a < b ? -1 : 1)).map(([, drawing]) => drawing);
    }

    isShown(drawing) {
        return !this.#hidden.has(title(drawing));
    }

    show(drawing, shown) {
        if (shown) this.#hidden.delete(title(drawing));
        else this.#hidden.add(title(drawing));
    }
}

/** The place of a point (m) of a drawing in the world; `null`: what is drawn on the robot, and it is not known where that is. */
export function placing({ frame }, robot) {
    if (frame === "world") return point => point;
    if (!robot) return null;
    return point => add(robot.position, rotate(robot.quaternion, point));
}

/** Keeps the list of drawings up to date: a switch an app, for all of its drawings, and one a drawing. */
export function drawingList(world) {
    const card = by("drawings");
    const group = card.querySelector("div");
    card.open = matchMedia("(min-width: 761px) and (min-height: 561px)").matches;
    const rows = () => {
        const rows = [];
        for (const drawing of world.drawings.list()) {
            if (rows.at(-1)?.app !== drawing.app) rows.push({ app: drawing.app, key: drawing.app, drawings: [] });
            rows.at(-1).drawings.push(drawing);
        }
        return rows.flatMap(row => [
            row,
            ...row.drawings.map(drawing => ({ app: row.app, key: title(drawing), drawing, drawings: [drawing] })),
        ]);
    };
    const makeRow = row => {
        const box = make("input", {
            type: "checkbox",
            onchange: event => world.showDrawings(label.drawings, event.target.checked),
        });
        const label = make("label", { class: row.drawing ? "part" : "" }, box, make("span"));
        return label;
    };
    const update = (label, row) => {
        label.drawings = row.drawings;
        const shown = row.drawings.filter(drawing => world.drawings.isShown(drawing)).length;
        const [box, name] = label.children;
        box.checked = shown > 0;
        box.indeterminate = shown > 0 && shown < row.drawings.length;
        say(name, row.drawing?.name ?? row.app);
    };
    const show = () => {
        const all = rows();
        card.hidden = all.length === 0;
        keep(group, all, ({ key }) => key, makeRow, update);
    };
    world.watch(what => what === "drawings" && show());
    show();
}
