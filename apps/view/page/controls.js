// Hands on a view: mouse, fingers and keys move its camera.

const TURN_PER_PIXEL = 0.006;
const KEY_TURN = Math.PI / 24;
const KEY_PAN = 0.08;

/** Lets a canvas move the camera: a drag orbits (pans, if the view is flat), two fingers pan and pinch, keys do both. */
export function control(canvas, camera, { flat }) {
    const pointers = new Map();
    const drag = (event, dx, dy) => {
        const height = canvas.clientHeight;
        if (flat || event.shiftKey || event.buttons & 6) pan(camera, flat, dx / height, dy / height);
        else camera.orbit(dx * TURN_PER_PIXEL, dy * TURN_PER_PIXEL);
    };
    canvas.addEventListener("pointerdown", event => {
        canvas.setPointerCapture(event.pointerId);
        pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener("pointermove", event => {
        const before = pointers.get(event.pointerId);
        if (!before) return;
        const now = [event.clientX, event.clientY];
        const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
        pointers.set(event.pointerId, now);
        if (other) pinch(camera, flat, canvas.clientHeight, before, now, other);
        else drag(event, now[0] - before[0], now[1] - before[1]);
    });
    for (const end of ["pointerup", "pointercancel"]) {
        canvas.addEventListener(end, event => pointers.delete(event.pointerId));
    }
    canvas.addEventListener("contextmenu", event => event.preventDefault());
    canvas.addEventListener(
        "wheel",
        event => {
            event.preventDefault();
            const pixels = event.deltaY * [1, 16, 400][event.deltaMode];
            camera.zoom(Math.exp(Math.max(-300, Math.min(300, pixels)) * 0.0015));
        },
        { passive: false },
    );
    canvas.addEventListener("keydown", event => {
        if (!event.ctrlKey && !event.metaKey && !event.altKey && key(camera, flat, event)) event.preventDefault();
    });
}

/** A flat view has its own up: the world's y. */
function pan(camera, flat, right, down) {
    if (!flat) return camera.pan(right, -down);
    const metres = camera.heightAtTarget();
    camera.slide([-right * metres, down * metres, 0]);
}

function pinch(camera, flat, height, before, now, other) {
    const apart = point => Math.max(20, Math.hypot(point[0] - other[0], point[1] - other[1]));
    camera.zoom(apart(before) / apart(now));
    pan(camera, flat, (now[0] - before[0]) / 2 / height, (now[1] - before[1]) / 2 / height);
}

/** Whether the key meant something to the camera. */
function key(camera, flat, event) {
    const direction = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (direction) {
        const [right, down] = direction;
        if (flat || event.shiftKey) pan(camera, flat, right * KEY_PAN, down * KEY_PAN);
        else camera.orbit(right * KEY_TURN, down * KEY_TURN);
    } else if (event.key === "+" || event.key === "=") {
        camera.zoom(0.85);
    } else if (event.key === "-") {
        camera.zoom(1 / 0.85);
    } else {
        return false;
    }
    return true;
}
