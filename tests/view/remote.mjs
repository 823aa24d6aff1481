// A page of a browser, driven by whoever starts this: a line of JSON in, a line of JSON out.
//
//     {"open": URL} {"until": EXPRESSION} {"press": KEY} {"picture": FILE} {"errors": true}
//
// An answer is {"value": …} or {"error": "…"}; the first line says whether there is a browser. The end of the input ends it.

import { createInterface } from "node:readline";

import { Browser } from "./browser.mjs";

const browser = await Browser.start();
const answer = words => process.stdout.write(`${JSON.stringify(words)}\n`);
let page;

const COMMANDS = {
    open: async url => void (page = await browser.open(url)),
    until: expression => page.until(expression),
    press: key => page.press(key),
    picture: file => page.picture(file),
    errors: () => browser.errors.splice(0),
};

answer({ value: browser !== null });
if (browser) {
    for await (const line of createInterface({ input: process.stdin })) {
        const [[command, argument]] = Object.entries(JSON.parse(line));
        try {
            answer({ value: (await COMMANDS[command](argument)) ?? null });
        } catch (error) {
            answer({ error: error.message });
        }
    }
    await browser.close();
}
