// The page: makes its parts, and gives keys and connection something to do.

import { AppKeys } from "./appkeys.js";
import { connection } from "./connection.js";
import { help } from "./help.js";
import { Link } from "./link.js";
import { Orders } from "./orders.js";
import { appsPanel } from "./panels/apps.js";
import { Events } from "./panels/events.js";
import { logsPanel } from "./panels/logs.js";
import { Plots } from "./panels/plots.js";
import { runPanel } from "./panels/run.js";
import { steering } from "./panels/steering.js";
import { timeline } from "./panels/timeline.js";
import { variablesPanel } from "./panels/variables.js";
import { Stage } from "./stage.js";
import { Tabs } from "./tabs.js";
import { theme } from "./theme.js";
import { LAYERS, World } from "./world.js";

const by = id => document.getElementById(id);

const address = new URL(`ws${location.search}`, location.href);
address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
const link = new Link(address);
const world = new World(link);

const tabs = new Tabs(by("tabs"), by("panels"));
const shown = {};
const panels = Object.fromEntries(
    [
        ["run", "Run"],
        ["apps", "Apps"],
        ["variables", "Variables"],
        ["logs", "Logs"],
        ["events", "Events"],
    ].map(([id, name]) => [id, tabs.add(id, name, is => shown[id]?.(is))]),
);
const events = new Events(panels.events, by("toasts"), link);
const tell = (text, mood) => events.say(text, mood);
const orders = new Orders(link, tell);
const appKeys = new AppKeys(link, orders, tell);
const plots = new Plots(link);
const logs = logsPanel(panels.logs, { link });
const variables = variablesPanel(panels.variables, { link, orders, plots, say: tell });
runPanel(panels.run, { link, plots });
appsPanel(panels.apps, {
    link,
    orders,
    dialog: by("form"),
    showLog: name => {
        logs.choose(name);
        tabs.show("logs");
    },
});
Object.assign(shown, { logs: logs.shown, variables: variables.shown });
tabs.show("run");

const bar = by("bar");
const steer = steering(bar, { link, orders });
const line = timeline(bar, { link });
const stage = new Stage({ link, world, tell });
const nextTheme = theme(by("theme"));
const openHelp = help(by("help"), appKeys);
by("help-button").addEventListener("click", openHelp);
connection(link, events);

// Keys, wherever the focus is but in a field.

const KEYS = {
    "?": openHelp,
    v: () => stage.showFlat(!stage.isFlat),
    f: () => stage.follow(),
    h: () => stage.whole(),
    "[": () => stage.height.move(-1),
    "]": () => stage.height.move(1),
    "\\": () => world.clipAt(null),
    n: () => steer.isShown() && steer.step(),
    t: nextTheme,
    "/": () => {
        tabs.show("variables");
        variables.search.focus();
    },
    " ": () => {
        if (line.isShown()) line.toggle();
        else if (steer.isShown()) steer.toggle();
    },
};
for (const [layer, { key }] of Object.entries(LAYERS)) KEYS[key] = () => world.show(layer, !world.shown.has(layer));

addEventListener("keydown", event => {
    const { target, key } = event;
    const inField = target.closest?.("input:not([type=checkbox]):not([type=range]), select, textarea, dialog[open]");
    // A button of a dialog that was closed keeps the focus until the next frame.
    const pressing = key === " " && target.closest?.("button, input, summary")?.checkVisibility();
    const named = key.length === 1 ? key.toLowerCase() : key;
    const action = KEYS[named];
    // On some keyboards a bracket is typed with AltGr, which is no command to the browser.
    const isTyped = event.getModifierState("AltGraph");
    const command = (event.ctrlKey || event.metaKey) && !isTyped;
    const alt = event.altKey && !isTyped;
    if (inField || pressing || command) return;
    if (action && alt) return;
    if (!action && !appKeys.press(named, { shift: event.shiftKey, alt })) return;
    event.preventDefault();
    action?.();
});

/** What tests and measurements read. */
window.elk = {
    link,
    world,
    stage,
    appKeys,
    keys: Object.keys(KEYS),
    events,
    get occupied() {
        return world.voxels.occupied;
    },
    get known() {
        return world.voxels.known;
    },
    get frontier() {
        return world.voxels.frontier;
    },
};

link.connect();
