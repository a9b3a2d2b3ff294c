// What the tests of the page ask it. Nothing here changes it.
export function offerTest(page) {
  const { camera, hands, renderer, curves } = page;
  const index = (name) => page.scene.bodies.findIndex((body) => body.name === name);
  const round = (p) => p && p.map((x) => Math.round(10 * x) / 10);
  window.rtbusTest = {
    page,
    frames: () => page.seen.frames,
    pictures: () => page.seen.pictures,
    ready: () => page.scene !== null && page.seen.frames > 0 && page.seen.pictures > 0 &&
      renderer.bodies.meshes.filter(Boolean).length === page.scene.meshes,
    word: () => document.getElementById('word').textContent,
    reason: () => document.getElementById('reason').textContent,
    drawCalls: () => renderer.calls,
    bodyAt: (name) => renderer.bodies.position(index(name), performance.now()),
    bodyOnScreen: (name) => round(camera.project(renderer.bodies.position(index(name), performance.now()))),
    proxyOnScreen: (i = 0) => round(camera.project(hands.now[i].proxy)),
    arrowOnScreen: (i = 0) => [hands.now[i].proxy, hands.arrowTip(hands.now[i])].map((p) => round(camera.project(p))),
    /** Colours at points, which are computed when the next picture has been drawn. */
    colours: (points) => new Promise((resolve) => {
      page.afterPicture = () => {
        page.afterPicture = undefined;
        const at = points();
        resolve({ at, colours: renderer.colours(at) });
      };
    }),
    lanes: () => { curves.draw(performance.now(), true); return curves.shown.lanes; },
  };
}
