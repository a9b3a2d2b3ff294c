// The hands of a session: proxy, device, the spring between them, the force, the workspace, the trail of the tip.
import { add, niceAbove, norm, rotate, scale, sub } from './math.js';

const kColours = [[0.13, 0.40, 0.72, 1], [0.10, 0.55, 0.36, 1], [0.55, 0.30, 0.66, 1], [0.72, 0.45, 0.08, 1]];
const kForce = [0.80, 0.07, 0.15, 1];
const kTrail_s = 3;

const faded = (colour, alpha) => [colour[0], colour[1], colour[2], alpha];
export const handColour = (i) => kColours[i % kColours.length];
export const cssColour = (c) => `rgb(${c.slice(0, 3).map((x) => Math.round(255 * x)).join(' ')})`;

export class Hands {
  constructor() {
    this.now = [];
    this.contacts = [];
    this.trails = [];
  }

  setScene(scene, radius) {
    this.about = scene.hands;
    this.radius = radius;
    this.now = [];
    this.contacts = [];
    this.trails = scene.hands.map(() => []);
    this.peak = 0.1 * Math.max(1, ...scene.hands.map((hand) => hand.force_limit_n));
    this.scaleArrows();
  }

  clearTrails() { this.trails = this.trails.map(() => []); }

  /** The longest arrow is between a quarter and five eighths of the scene's radius; the scale never grows back. */
  scaleArrows() { this.newtonsPerCm = niceAbove(this.peak / (62 * this.radius)); }

  take(frame) {
    this.now = frame.hands;
    this.contacts = frame.contacts;
    const peak = Math.max(this.peak, ...this.now.map((hand) => norm(hand.force)));
    if (peak > this.peak) {
      this.peak = peak;
      this.scaleArrows();
    }
    this.now.forEach((hand, i) => {
      const trail = this.trails[i];
      if (!trail) return;
      trail.push({ at: frame.now, p: [...hand.proxy] });
      while (trail[0].at < frame.now - kTrail_s) trail.shift();
    });
  }

  drawnRadius(hand) { return Math.max(hand.radius, 0.026 * this.radius); }
  arrowTip(hand) { return add(hand.proxy, scale(hand.force, 1 / (100 * this.newtonsPerCm))); }

  /** @param show { contacts, trail, workspace } */
  draw(pieces, show) {
    const thin = 0.004 * this.radius;
    this.now.forEach((hand, i) => {
      const colour = handColour(i), r = this.drawnRadius(hand);
      pieces.sphere(hand.proxy, r, colour);
      pieces.sphere(hand.device, 0.6 * r, faded(colour, 0.45));
      if (norm(sub(hand.device, hand.proxy)) > 0.3 * r) pieces.rod(hand.proxy, hand.device, thin, faded(colour, 0.8));
      if (norm(hand.force) > 0.005) pieces.arrow(hand.proxy, this.arrowTip(hand), 0.011 * this.radius, kForce);
      if (show.workspace) this.workspace(pieces, hand, this.about[i], faded(colour, 0.6));
      const trail = this.trails[i];
      for (let k = 1; show.trail && k < trail.length; ++k) {
        const alpha = (at) => 0.9 * (1 - (trail.at(-1).at - at) / kTrail_s);
        pieces.line(trail[k - 1].p, trail[k].p, faded(colour, alpha(trail[k - 1].at)), faded(colour, alpha(trail[k].at)));
      }
    });
    for (const contact of show.contacts ? this.contacts : []) {
      const touches = contact.gap <= 0, colour = touches ? [0.95, 0.55, 0.05, 1] : [0.45, 0.55, 0.60, 0.7];
      pieces.sphere(contact.point, 0.012 * this.radius, colour);
      pieces.arrow(contact.point, add(contact.point, scale(contact.normal, 0.12 * this.radius)), 0.005 * this.radius, colour);
    }
  }

  workspace(pieces, hand, about, colour) {
    const corner = (c) => add(hand.origin, scale(rotate(about.q_WD,
      [0, 1, 2].map((k) => ((c >> k) & 1 ? about.workspace_max_m[k] : about.workspace_min_m[k]))), about.position_scale));
    for (let c = 0; c < 8; ++c) {
      for (let k = 0; k < 3; ++k) if (!((c >> k) & 1)) pieces.line(corner(c), corner(c | (1 << k)), colour);
    }
  }

  /** Texts beside the arrows: [{ p, text, colour }]. */
  labels() {
    const many = this.now.length > 1;
    return this.now.filter((hand) => norm(hand.force) >= 0.005).map((hand, i) => ({
      p: this.arrowTip(hand), text: `${many ? `${this.about[i].name} ` : ''}${norm(hand.force).toFixed(2)} N`,
      colour: cssColour(kForce) }));
  }
}
