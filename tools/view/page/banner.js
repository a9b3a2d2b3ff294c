// What can be read across a room: the state in a word, and why. Figures and notes in small print.
const $ = (id) => document.getElementById(id);

export class Banner {
  constructor() { this.connected = false; }

  trouble(text) {
    this.connected = false;
    this.show('DISCONNECTED', text, 'bad');
  }

  state(state) {
    this.connected = true;
    const many = state.hands.length > 1;
    const worst = state.hands.filter((hand) => hand.word !== 'NORMAL');
    const reason = many && worst.length > 0 ? worst.map((hand) => `${hand.name} ${hand.word}: ${hand.reason}`).join('\n') : state.reason;
    this.show(state.word, reason, state.level);
    this.problem = state.problem;
    this.notes();
    document.title = `${state.word} – ${state.session || 'rtbus view'}`;
  }

  show(word, reason, level) {
    $('word').textContent = word;
    $('reason').textContent = reason;
    $('banner').dataset.level = level;
  }

  scene(scene) {
    this.sceneNotes = scene.notes;
    this.notes();
  }

  notes() {
    const lines = [...(this.sceneNotes ?? []), ...(this.problem ? [this.problem] : [])];
    $('notes').hidden = lines.length === 0;
    $('notes').textContent = lines.join('\n');
  }

  /** @param shown { session, frames_hz, bodies, calls, bytes_s, simulated } of the page itself. */
  facts(figures, shown) {
    const lines = [`session ${shown.session}`];
    for (const hand of figures?.haptic ?? []) {
      lines.push(`${hand.name}: ${hand.rate_hz?.toFixed(0) ?? '–'} Hz, ${hand.method ?? ''}, ${hand.overruns ?? '–'} overruns`);
    }
    for (const node of figures?.physics ?? []) {
      lines.push(`${node.name}: ${node.engine ?? ''} ${node.rate_hz?.toFixed(0) ?? '–'} Hz, step ${node.step_ms?.p50?.toFixed(2) ?? '–'} ms`);
    }
    lines.push(`picture: ${shown.frames_hz.toFixed(0)} Hz, ${shown.bodies} bodies, ${(shown.bytes_s / 1000).toFixed(0)} kB/s`);
    $('facts').textContent = lines.join('\n');
  }

  legend(newtonsPerCm, movedMost_m, coloured) {
    const parts = [`arrow: 1 cm of the scene is ${newtonsPerCm} N`];
    if (coloured && movedMost_m > 0) parts.push(`moved: grey 0, yellow ${1000 * movedMost_m / 2} mm, red ${1000 * movedMost_m} mm or more`);
    $('legend').textContent = parts.join('\n');
  }
}
