// Dark, light, or as the system: a switch that is remembered.

const SCHEMES = { auto: ["◐", "as the system"], dark: ["☾", "dark"], light: ["☀", "light"] };
const STORED = "elk-scheme";

/** Makes `button` the switch; the window hears of other colours by the event `scheme`. Returns what switches. */
export function theme(button) {
    let scheme = stored();
    const changed = () => dispatchEvent(new Event("scheme"));
    const show = () => {
        document.documentElement.style.colorScheme = scheme === "auto" ? "" : scheme;
        button.textContent = SCHEMES[scheme][0];
        button.setAttribute("aria-label", `Colours: ${SCHEMES[scheme][1]}`);
        changed();
    };
    const next = () => {
        const names = Object.keys(SCHEMES);
        scheme = names[(names.indexOf(scheme) + 1) % names.length];
        try {
            localStorage.setItem(STORED, scheme);
        } catch {
            // A browser that remembers nothing is asked again next time.
        }
        show();
    };
    button.addEventListener("click", next);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", changed);
    show();
    return next;
}

function stored() {
    try {
        const scheme = localStorage.getItem(STORED);
        return Object.hasOwn(SCHEMES, scheme) ? scheme : "auto";
    } catch {
        return "auto";
    }
}
