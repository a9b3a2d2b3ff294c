// The page: what comes over the link goes to the scene, the curves and the banner; one picture per animation frame.
import { Banner } from './banner.js';
import { Camera } from './camera.js';
import { Curves } from './curves.js';
import { Hands } from './hands.js';
import { Link } from './link.js';
import { Orders } from './orders.js';
import { Playback } from './playback.js';
import { offerTest } from './test_hooks.js';
import { niceAbove } from './math.js';
import { Renderer } from './renderer.js';

const $ = (id) => document.getElementById(id);
const options = new URLSearchParams(location.search);
const kHover_ms = 150, kFacts_ms = 500;

class Page {
  constructor() {
    this.banner = new Banner();
    this.hands = new Hands();
    this.curves = new Curves();
    this.show = { contacts: false, trail: true, workspace: false, moved: true, follow: false, hold: false, light: true };
    this.seen = { frames: 0, pictures: 0, bytes: 0, since: performance.now(), picturesThen: 0, bytesThen: 0, hz: 0, bytes_s: 0 };
    this.scene = null;
    this.mouse = null;
    this.renderer = new Renderer($('picture'), options.has('low'));
    this.camera = new Camera($('picture'));
    this.listen();
    this.setTheme(options.get('theme') ?? (matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light'));
    this.link = new Link({
      document: (json) => this.document(json),
      mesh: (mesh) => this.mesh(mesh),
      frame: (frame) => this.frame(frame),
      trouble: (text) => { this.banner.trouble(text); this.orders.connected(false); },
    });
    this.orders = new Orders((order) => this.link.order(order));
    this.playback = new Playback((play) => this.link.play(play));
    requestAnimationFrame((now) => this.picture(now));
  }

  document(json) {
    if (json.type === 'scene') this.setScene(json);
    if (json.type === 'state') this.banner.state(json);
    if (json.type === 'figures') this.figures = json;
    if (json.type === 'hello') this.orders.connected(true);
    if (json.type === 'orders') this.orders.state(json);
    if (json.type === 'playback') this.playback.state(json);
    if (json.type === 'answer') this.orders.answer(json);
  }

  /** The same scene again (a page that was hidden, a server that was restarted) keeps camera, curves and meshes. */
  setScene(scene) {
    const text = JSON.stringify({ ...scene, number: 0 });
    if (text === this.sceneText) {
      this.scene.number = scene.number;
      return;
    }
    this.sceneText = text;
    this.scene = scene;
    this.renderer.bodies.setScene(scene);
    this.home();
    this.curves.setScene(scene);
    this.banner.scene(scene);
    this.movedAt = 0;
  }

  mesh(mesh) {
    if (this.scene === null || mesh.scene !== this.scene.number || this.renderer.bodies.meshes[mesh.index]) return;
    this.renderer.bodies.addMesh(mesh);
    this.home();
  }

  home() {
    const { centre, radius } = this.renderer.bodies;
    this.camera.setHome(centre, radius);
    this.hands.setScene(this.scene, radius);
  }

  frame(frame) {
    this.seen.bytes += frame.bytes;
    if (this.scene === null || frame.scene !== this.scene.number) return;
    ++this.seen.frames;
    this.newest = frame;
    if (frame.nodes) this.lastNodes = frame.nodes;
    if (frame.jumps !== this.jumps) {
      this.jumps = frame.jumps;
      this.curves.clear();
      this.hands.clearTrails();
    }
    this.playback.show(frame.now);
    this.curves.take(frame);
    if (this.show.hold) return;
    this.hands.take(frame);
    this.renderer.bodies.take(frame, performance.now());
  }

  listen() {
    addEventListener('keydown', (e) => {
      if (e.ctrlKey || e.metaKey || e.altKey || ['INPUT', 'SELECT'].includes(e.target.tagName)) return;
      if (e.key === ' ') e.preventDefault();
      this.key(e.key === ' ' ? 'p' : e.key.toLowerCase());
    });
    for (const button of $('tools').querySelectorAll('[data-key]')) {
      button.onclick = () => { this.key(button.dataset.key); button.blur(); };
    }
    $('picture').addEventListener('pointermove', (e) => { this.mouse = { x: e.offsetX, y: e.offsetY, moved: true, at: performance.now() }; });
    $('picture').addEventListener('pointerleave', () => { this.mouse = null; $('hover').hidden = true; });
    this.key('');
  }

  key(key) {
    const flags = { f: 'follow', c: 'contacts', t: 'trail', w: 'workspace', m: 'moved', p: 'hold' };
    if (this.playback?.key(key)) return;
    if (key in flags) this.show[flags[key]] = !this.show[flags[key]];
    if (key === 'r') { this.show.follow = false; this.camera.reset(); }
    if (key === 'e') this.orders.estop();
    if (key === 'l') this.setTheme(this.renderer.theme === 'light' ? 'dark' : 'light');
    for (const button of $('tools').querySelectorAll('[data-key]')) {
      const flag = flags[button.dataset.key];
      if (flag) button.setAttribute('aria-pressed', this.show[flag]);
    }
  }

  setTheme(theme) {
    this.renderer.theme = theme === 'dark' ? 'dark' : 'light';
    document.documentElement.dataset.theme = this.renderer.theme;
  }

  picture(now) {
    requestAnimationFrame((next) => this.picture(next));
    this.link.acknowledge(now);
    this.renderer.resize();
    if (this.show.follow && this.hands.now[0]) this.camera.target = [...this.hands.now[0].proxy];
    if (this.scene !== null) {
      this.hover(now);
      this.colourMoved(now);
      this.renderer.draw(this.camera, this.hands, this.show, now);
      ++this.seen.pictures;
    } else {
      this.renderer.clear();
    }
    this.drawLabels();
    this.curves.draw(now);
    this.facts(now);
    this.afterPicture?.();
  }

  hover(now) {
    if (this.mouse === null || !this.mouse.moved || now < this.mouse.at + kHover_ms) return;
    this.mouse.moved = false;
    const name = this.renderer.pick(this.camera, this.mouse.x, this.mouse.y, now);
    $('hover').hidden = name === undefined;
    $('hover').textContent = name ?? '';
    $('hover').style.transform = `translate(${this.mouse.x + 14}px, ${this.mouse.y + 10}px)`;
  }

  colourMoved(now) {
    if (now < this.movedAt + kFacts_ms) return;
    this.movedAt = now;
    const far = this.renderer.bodies.movedMost();
    this.movedMost = far > 0.002 * this.renderer.bodies.radius ? Math.max(niceAbove(far), this.movedMost ?? 0) : 0;
    this.renderer.movedMost = this.show.moved ? this.movedMost : 0;
    this.banner.legend(this.hands.newtonsPerCm, this.movedMost, this.show.moved);
  }

  drawLabels() {
    const labels = this.hands.labels();
    const box = $('labels');
    while (box.children.length < labels.length) box.append(Object.assign(document.createElement('span'), { className: 'label' }));
    [...box.children].forEach((span, i) => {
      const at = labels[i] && this.camera.project(labels[i].p);
      span.hidden = !at;
      if (!at) return;
      span.textContent = labels[i].text;
      span.style.color = labels[i].colour;
      span.style.transform = `translate(${Math.round(at[0] + 8)}px, ${Math.round(at[1] - 10)}px)`;
    });
  }

  facts(now) {
    const seen = this.seen, elapsed = now - seen.since;
    if (elapsed < kFacts_ms) return;
    seen.hz = 1000 * (seen.pictures - seen.picturesThen) / elapsed;
    seen.bytes_s = 1000 * (seen.bytes - seen.bytesThen) / elapsed;
    Object.assign(seen, { since: now, picturesThen: seen.pictures, bytesThen: seen.bytes });
    this.banner.facts(this.figures, { session: this.scene?.session ?? '–', frames_hz: seen.hz, bytes_s: seen.bytes_s,
      bodies: this.scene?.bodies.length ?? 0, calls: this.renderer.calls });
  }
}

try {
  offerTest(new Page());
} catch (error) {
  $('word').textContent = 'NO PICTURE';
  $('reason').textContent = error.message;
  throw error;
}
