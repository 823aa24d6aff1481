// What a person has the mission do: orders and pokes go out with a number, and their answers are said where it can be seen.

export class Orders {
    #waiting = new Map();
    #types = null;

    /** `say(text, mood)` tells a person. */
    constructor(link, say) {
        Object.assign(this, { link, say, readOnly: true });
        link.on("hello", hello => {
            this.readOnly = hello.read_only || !hello.live;
            this.#types = null;
        });
        link.on("answer", answer => this.#answered(answer));
        link.on("types", message => this.#waiting.get(message.id)?.resolve?.(message.elements));
        link.on("link", ({ state }) => {
            if (state === "waiting") this.#giveUp();
        });
    }

    /** Gives an order, as `{command, app, …}`; `words` says in plain text what it is. */
    order(order, words) {
        this.#send({ type: "order", order }, { words });
    }

    /** Publishes a value under a key. */
    poke(key, value) {
        this.#send({ type: "poke", key, value }, { words: `Poke ${key}` });
    }

    /** Presses a key that an app has declared; only that this failed is said. */
    press({ app, key, meaning }, modifiers) {
        this.#send({ type: "press", app, key, ...modifiers }, { words: `${app}, ${meaning}`, quiet: true });
    }

    /** The elements with their types and parameters, asked for once a connection. */
    types() {
        this.#types ??= new Promise((resolve, reject) =>
            this.#send({ type: "types" }, { words: "Types", resolve, reject }),
        );
        return this.#types;
    }

    #send(message, waiting) {
        const id = this.link.nextId();
        if (!this.link.fits(message)) this.#failed(waiting, "that is longer than a page may say, which is 64 kB");
        else if (this.link.send({ ...message, id })) this.#waiting.set(id, waiting);
        else this.#failed(waiting, "there is no connection");
    }

    #answered({ id, ok, text }) {
        const waiting = this.#waiting.get(id);
        if (ok !== null && ok !== undefined) this.#waiting.delete(id);
        const words = waiting ? `${waiting.words}: ${text}` : text;
        if (ok === false && waiting?.reject) this.#failed(waiting, text);
        else if (ok === false || !waiting?.quiet) this.say(words, ok === false ? "bad" : ok ? "good" : "");
    }

    #giveUp() {
        for (const waiting of this.#waiting.values())
            this.#failed(waiting, "the connection was lost before an answer came");
        this.#waiting.clear();
    }

    #failed(waiting, why) {
        this.#types = waiting.reject ? null : this.#types;
        waiting.reject?.(new Error(why));
        this.say(`${waiting.words}: ${why}`, "bad");
    }
}
