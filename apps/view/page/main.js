// The page: makes its parts, and gives keys and connection something to do.

import { say } from "./dom.js";
import { help } from "./help.js";
import { Link } from "./link.js";
import { VERSION } from "./messages.js";
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
const panels = Object.fromEntries([["run", "Run"], ["apps", "Apps"], ["variables", "Variables"], ["logs", "Logs"], ["events", "Events"]]
    .map(([id, name]) => [id, tabs.add(id, name, is => shown[id]?.(is))]));
const events = new Events(panels.events, by("toasts"), link);
const tell = (text, mood) => events.say(text, mood);
const orders = new Orders(link, tell);
const plots = new Plots(link);
const logs = logsPanel(panels.logs, { link });
const variables = variablesPanel(panels.variables, { link, orders, plots, say: tell });
runPanel(panels.run, { link, plots });
appsPanel(panels.apps, {
    link, orders, dialog: by("form"),
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
const openHelp = help(by("help"));
by("help-button").addEventListener("click", openHelp);

// What the head says: whom one looks at, and whether there is still somebody.

let hello = null;
let status = { connected: true, text: "" };

function showConnection() {
    const badge = by("badge");
    const what = hello?.recorded ? "recorded" : "live";
    const state = link.state !== "open" || hello === null ? "waiting" : status.connected ? what : "gone";
    badge.dataset.state = state;
    say(badge, { waiting: "connecting", gone: "no community" }[state] ?? (hello.read_only && state === "live" ? "live, read only" : state));
    const [text, button] = by("notice").children;
    const seconds = Math.max(0, Math.ceil((link.nextTry - performance.now()) / 1000));
    const lost = link.state === "waiting";
    const said = lost ? `${hello ? "Connection lost" : "No connection"}${link.reason ? ` (${link.reason})` : ""}: trying again ${seconds ? `in ${seconds} s` : "now"}.`
        : !status.connected ? status.text : hello && hello.version !== VERSION ? `The server speaks version ${hello.version} of the protocol, this page ${VERSION}.` : "";
    by("notice").hidden = said === "";
    button.hidden = !lost;
    say(text, said);
}

link.on("hello", message => {
    hello = message;
    status = { connected: true, text: "" };
    const name = message.mission ?? message.recorded?.log ?? message.live?.community ?? "";
    say(by("mission"), name);
    document.title = name ? `${name} – elk` : "elk";
    showConnection();
});
link.on("status", message => {
    if (message.connected !== status.connected) tell(message.text, message.connected ? "good" : "bad");
    status = message;
    showConnection();
});
link.on("progress", ({ phase }) => say(by("phase"), phase ?? ""));
link.on("link", ({ state }) => {
    if (state === "waiting" && hello !== null) events.note("Connection lost", "bad", "page");
    showConnection();
});
setInterval(() => {
    if (link.state === "waiting") showConnection();
}, 500);
by("notice").querySelector("button").addEventListener("click", () => link.retry());
for (const back of ["online", "pageshow"]) addEventListener(back, () => link.retry());

// Keys, wherever the focus is but in a field.

const KEYS = {
    "?": openHelp,
    v: () => stage.showFlat(!stage.isFlat),
    f: () => stage.follow(),
    h: () => stage.whole(),
    "[": () => stage.moveClip(-1),
    "]": () => stage.moveClip(1),
    "\\": () => stage.unclip(),
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
for (const [layer, { key }] of Object.entries(LAYERS)) KEYS[key] = () => stage.toggleLayer(layer);

addEventListener("keydown", event => {
    const { target, key } = event;
    const inField = target.closest?.("input:not([type=checkbox]):not([type=range]), select, textarea, dialog");
    const pressing = key === " " && target.closest?.("button, input, summary");
    const action = KEYS[key.length === 1 ? key.toLowerCase() : key];
    if (inField || pressing || !action || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    action();
});

/** What tests and measurements read. */
window.elk = {
    link, world, stage, events,
    get occupied() { return world.voxels.occupied; },
    get known() { return world.voxels.known; },
    get frontier() { return world.voxels.frontier; },
};

link.connect();
