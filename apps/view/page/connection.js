// The head of the page: whom one looks at, and, in one line below it, when there is nobody.

import { say } from "./dom.js";
import { VERSION } from "./messages.js";

const by = id => document.getElementById(id);
const BADGES = { waiting: "connecting", gone: "no community", "read-only": "live, read only" };
/** How often the seconds to the next try are counted down (ms). */
const COUNT_MS = 500;

/** Keeps the head up to date; what happens to the connection goes to the events, too. */
export function connection(link, events) {
    let hello = null;
    let status = { connected: true, text: "" };

    const state = () => {
        if (link.state !== "open" || hello === null) return "waiting";
        if (!status.connected) return "gone";
        if (hello.recorded) return "recorded";
        return hello.read_only ? "read-only" : "live";
    };
    const trouble = () => {
        if (link.state === "waiting") return lost(link, hello);
        if (!status.connected) return status.text;
        if (hello === null || hello.version === VERSION) return "";
        return `The server speaks version ${hello.version} of the protocol, this page ${VERSION}.`;
    };
    const show = () => {
        const [text, button] = by("notice").children;
        by("badge").dataset.state = state();
        say(by("badge"), BADGES[state()] ?? state());
        by("notice").hidden = trouble() === "";
        button.hidden = link.state !== "waiting";
        say(text, trouble());
    };

    link.on("hello", message => {
        hello = message;
        status = { connected: true, text: "" };
        const name = message.mission ?? message.recorded?.log ?? message.live?.community ?? "";
        say(by("mission"), name);
        document.title = name ? `${name} – elk` : "elk";
        show();
    });
    link.on("status", message => {
        const news = message.connected ? "The community is there" : message.text;
        if (message.connected !== status.connected) events.say(news, message.connected ? "good" : "bad");
        status = message;
        show();
    });
    link.on("damage", ({ text }) => events.say(text, "bad"));
    link.on("link", ({ state }) => {
        if (state === "waiting" && hello !== null) events.note(what(link, hello), "bad", "page");
        show();
    });
    link.on("progress", ({ phase }) => say(by("phase"), phase ?? ""));
    setInterval(() => link.state === "waiting" && show(), COUNT_MS);
    by("notice")
        .querySelector("button")
        .addEventListener("click", () => link.retry());
    for (const back of ["online", "pageshow"]) addEventListener(back, () => link.retry());
}

/** What is amiss with the connection. */
function what({ reason, hasEnded }, hello) {
    if (hasEnded) return "The view has ended, and what it showed last stays";
    return `${hello ? "Connection lost" : "No connection"}${reason ? ` (${reason})` : ""}`;
}

function lost(link, hello) {
    const seconds = Math.max(0, Math.ceil((link.nextTry - performance.now()) / 1000));
    return `${what(link, hello)}: trying again ${seconds > 0 ? `in ${seconds} s` : "now"}.`;
}
