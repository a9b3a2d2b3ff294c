// A recording: time slider, speed, single ticks, marks.
const $ = (id) => document.getElementById(id);
const kDrag_ms = 60;

export class Playback {
  /** @param send(play) */
  constructor(send) {
    this.about = null;
    this.held = false;
    $('play').onclick = () => this.toggle(send);
    $('tick-back').onclick = () => send({ step: -1 });
    $('tick-on').onclick = () => send({ step: 1 });
    $('speed').onchange = (e) => { send({ speed: Number(e.target.value) }); e.target.blur(); };
    $('marks').onchange = (e) => { send({ at: Number(e.target.value), playing: false }); e.target.blur(); };
    let sentAt = 0, later = 0;
    $('time').oninput = () => {
      this.held = true;
      clearTimeout(later);
      later = setTimeout(() => {
        sentAt = performance.now();
        send({ at: Number($('time').value), playing: false });
      }, Math.max(0, sentAt + kDrag_ms - performance.now()));
    };
    $('time').onchange = () => { this.held = false; $('time').blur(); };
    this.send = send;
  }

  toggle() { this.send({ playing: !this.about.playing }); }
  /** @returns true when the key was one of the recording's. */
  key(key) {
    if (this.about === null) return false;
    if (key === 'p') this.toggle();
    else if (key === '.') this.send({ step: 1 });
    else if (key === ',') this.send({ step: -1 });
    else return false;
    return true;
  }

  /** Message `playback`. */
  state(json) {
    if (this.about === null) {
      $('playback').hidden = false;
      $('time').max = json.length_s;
      $('marks').replaceChildren(new Option('marks', ''), ...json.marks.map((m) => new Option(`${m.at_s.toFixed(3)} s ${m.text}`, m.at_s)));
      $('marks').hidden = json.marks.length === 0;
      document.querySelector('[data-key="p"]').hidden = true;
    }
    this.about = json;
    $('play').textContent = json.playing ? 'pause' : 'play';
    $('speed').value = String(json.speed);
    $('recording-file').textContent = `recording ${json.file}, ${json.started_utc}`;
  }

  /** @param now_s Of a frame. */
  show(now_s) {
    if (this.about === null) return;
    const at = now_s - this.about.begin_s;
    if (!this.held) $('time').value = at;
    $('time-text').textContent = `${at.toFixed(3)} / ${this.about.length_s.toFixed(3)} s`;
  }
}
