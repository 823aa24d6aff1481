// Colours: those of the style sheet for canvases, and the ramp by height.

const RAMP = ["#52759f", "#3583a8", "#2a9d8f", "#8ab17d", "#e9c46a", "#f4a261"].map(fromHex);
const NAMES = ["ground", "ink", "soft", "line", "accent", "free", "frontier", "plan", "way", "robot", "cut", "ghost"];

/** The ramp as one array of red, green, blue (0 to 1), for a shader. */
export const ramp = RAMP.flat();
export const RAMP_STEPS = RAMP.length;

/** The colour of a height between the lowest and the highest (0 to 1): red, green, blue (0 to 1). */
export function ofHeight(share) {
    const place = Math.max(0, Math.min(0.9999, share)) * (RAMP.length - 1);
    const step = Math.floor(place);
    return mix(RAMP[step], RAMP[step + 1], place - step);
}

let current = null;
addEventListener("scheme", () => (current = null));

/** The colours of the scheme that is in force, each as red, green, blue (0 to 1). */
export function scheme() {
    return (current ??= readScheme());
}

function readScheme() {
    const probe = document.createElement("span");
    document.body.append(probe);
    const colour = name => {
        probe.style.color = `var(--${name})`;
        return getComputedStyle(probe)
            .color.match(/[\d.]+/g)
            .slice(0, 3)
            .map(part => part / 255);
    };
    const colours = Object.fromEntries(NAMES.map(name => [name, colour(name)]));
    probe.remove();
    return colours;
}

/** Two colours, mixed by the share of the second. */
export function mix(one, other, share) {
    return one.map((part, i) => part + (other[i] - part) * share);
}

/** As CSS has it. */
export function css([red, green, blue], alpha = 1) {
    return `rgb(${[red, green, blue].map(part => Math.round(255 * part)).join(" ")} / ${alpha})`;
}

function fromHex(hex) {
    return [1, 3, 5].map(at => parseInt(hex.slice(at, at + 2), 16) / 255);
}
