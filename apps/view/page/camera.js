// From where the scene is looked at: a point, and a distance, yaw and pitch around it. The 2-D view looks at the same point.

import { add, cross, multiply, perspective, scale, viewFrom } from "./vectors.js";

/** Vertical angle of view (rad). */
const FOV = Math.PI / 4;
const STEEPEST = Math.PI / 2 - 0.001;
const FIRST = { yaw: -2.0, pitch: 0.85 };

export class Camera {
    target = [0, 0, 0];
    /** From the target (m). */
    distance = 12;
    /** Where the eye is as seen from the target (rad): around z from x, and above the horizon. */
    yaw = FIRST.yaw;
    pitch = FIRST.pitch;
    /** Whether the target stays with the robot. */
    follows = false;
    /** Whether somebody has looked around: from then on the camera is theirs. */
    touched = false;

    /** `changed(by)` is called with `hand` if a person has moved it, else with `map`. */
    constructor(changed) {
        this.changed = changed;
    }

    /** Changes some of the fields on a person's behalf. */
    move(fields) {
        Object.assign(this, fields, { touched: true });
        this.pitch = Math.max(-STEEPEST, Math.min(STEEPEST, this.pitch));
        this.distance = Math.max(0.2, Math.min(5000, this.distance));
        this.changed("hand");
    }

    orbit(yaw, pitch) {
        this.move({ yaw: this.yaw - yaw, pitch: this.pitch + pitch });
    }

    zoom(factor) {
        this.move({ distance: this.distance * factor });
    }

    /** Shifts the target with the picture, by parts of the picture's height. */
    pan(right, up) {
        const axes = this.axes();
        const metres = this.heightAtTarget();
        this.slide(add(scale(axes.right, -right * metres), scale(axes.up, -up * metres)));
    }

    /** Shifts the target by a vector (m); whoever does that no longer follows. */
    slide(vector) {
        this.move({ target: add(this.target, vector), follows: false });
    }

    /** How much of the world (m) the picture's height shows where the target is. */
    heightAtTarget() {
        return 2 * this.distance * Math.tan(FOV / 2);
    }

    /** Shows the whole of a box. */
    fit({ low, high }, aspect) {
        const size = high.map((value, i) => value - low[i]);
        const radius = Math.hypot(...size) / 2;
        this.target = low.map((value, i) => value + size[i] / 2);
        this.distance = Math.max(1, (1.02 * radius) / Math.tan(FOV / 2) / Math.min(1, aspect));
        this.changed("map");
    }

    /** As at the beginning: the camera shows the whole map as it grows. */
    release() {
        Object.assign(this, FIRST, { follows: false, touched: false });
        this.changed("map");
    }

    axes() {
        const [cosYaw, sinYaw] = [Math.cos(this.yaw), Math.sin(this.yaw)];
        const [cosPitch, sinPitch] = [Math.cos(this.pitch), Math.sin(this.pitch)];
        const back = [cosPitch * cosYaw, cosPitch * sinYaw, sinPitch];
        const right = [-sinYaw, cosYaw, 0];
        return { right, back, up: cross(back, right) };
    }

    eye() {
        return add(this.target, scale(this.axes().back, this.distance));
    }

    /** From the world (m) to clip space. */
    matrix(aspect) {
        const { right, up, back } = this.axes();
        const near = this.distance / 100;
        const projection = perspective(FOV, aspect, near, this.distance * 20 + 200);
        return multiply(projection, viewFrom(this.eye(), right, up, back));
    }
}
