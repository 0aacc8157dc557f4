"""report.py FILE: checks in a browser that a report draws, moves and answers; prints faults."""

import sys

import browser

# Pixels of the 3D view that are not of its background, and a sum that changes with the picture.
LOOK = """(() => {
  draw();
  const {drawingBufferWidth: width, drawingBufferHeight: height} = gl;
  const pixels = new Uint8Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  let drawn = 0, sum = 0;
  for (let i = 0; i < pixels.length; i += 4) {
    drawn += [0, 1, 2].some(k => Math.abs(pixels[i + k] - pixels[k]) > 8);  // the corner is empty
    sum = (sum * 31 + pixels[i] + 3 * pixels[i + 1] + 7 * pixels[i + 2]) % 1e9;
  }
  return {drawn, sum, corner: [...pixels.subarray(0, 3)]};
})()"""
TO_FRAME = "(slider.value = {}, slider.dispatchEvent(new Event('input')), now)"


def check(path, contacts=True):
    """The faults of a report, one sentence each. contacts: some frame has one."""
    faults = []

    def expect(holds, text):
        if not holds:
            faults.append(text)

    with browser.Page(path) as page:
        value = page.value
        held = value("replay.frames.map(f => f.at)")
        hidden = "replay.bodies.every((b, i) => bodies[i].visible === b.opacity > 0)"
        expect(value(hidden), "a body that pictures hide is shown, or another is not")
        expect(value("replay.bodies.every(b => b.name)"), "a body has no name")
        value("Object.assign(shown, {contacts: false, untrusted: false})")  # bodies alone
        value(TO_FRAME.format(held[0]))
        first = value(LOOK)
        expect(first["drawn"] > 500, f"bodies have {first['drawn']} pixels")
        value(TO_FRAME.format(held[-1]))
        expect(value("slider.value") == str(held[-1]), "the slider is not at the last frame")
        expect(len(held) == 1 or value(LOOK)["sum"] != first["sum"], "the slider moves no body")
        value("Object.assign(shown, {contacts: true, untrusted: true})")
        value("document.querySelector('canvas').focus()")
        page.key("Home")
        expect(value("now") == 0, "Home is not the first frame")
        page.key("ArrowRight")
        expect(value("now") == min(1, value("last")), "the arrow does not go to the next frame")
        page.key("w")
        expect(value("now") == value("data.worst.at"), "w does not go to the worst frame")
        expect(value("held.at") == value("now"), "the 3D view does not have the worst frame")
        # Each series that is not zero has a row, and each value over the budget a mark.
        rows = value("document.querySelectorAll('#time tr').length") - 1
        all_series = value("data.series")
        expect(rows == sum(any(s["values"]) for s in all_series), f"{rows} rows of series")
        over = [sum(v > s["budget"] for v in s["values"]) for s in all_series if "budget" in s]
        marks = value("[...document.querySelectorAll('#time path.marks')].map(p => p.outerHTML)")
        marked = [mark.count("v6") for mark in marks]
        expect(marked == [n for n in over if n], f"marks: {marked}, frames over budgets: {over}")
        table = value("fetch(byId('csv').href).then(r => r.text())")
        expect(table.count("\n") == value("data.frames.length") + 1, "a row of the CSV is missing")
        # A click on a contact names it; turning and zooming show something else.
        frame = value("(replay.frames.find(f => contactsOf(f).length) ?? {at: -1}).at")
        expect((frame >= 0) == contacts, f"the first frame with contacts is {frame}")
        if frame >= 0:
            value(TO_FRAME.format(frame))
            page.key(".")
            expect(value("picked === contacts[0]"), "the key does not pick a contact")
            value("pick(null)")
            box = value("(({left, top}) => [left, top])(gl.canvas.getBoundingClientRect())")
            x, y, _ = value("projector()(contacts[0].at)")
            page.click(box[0] + x, box[1] + y)
            expect(value("picked !== null"), "a click picks no contact")
            expect(value("byId('picked').textContent.length") > 20, "the contact is not described")
            if value("replay.frames.some(f => f.cells?.length)"):
                before = value(LOOK)
                page.key("o")
                page.key("o")
                expect(value(LOOK)["sum"] != before["sum"], "octree cells are not drawn")
        arrows = [f"{{key: 'ArrowLeft', {modifier}: true}}" for modifier in ("shiftKey", "ctrlKey")]
        for options in ("{key: '+'}", *arrows):
            before = value(LOOK)
            value(f"dispatchEvent(new KeyboardEvent('keydown', {options}))")
            expect(value(LOOK)["sum"] != before["sum"], f"no zoom, turn or move by {options}")
        expect(not page.problems, f"problems: {page.problems}")
    with browser.Page(path, dark=True) as page:
        page.value("bodies.forEach(b => b.visible = false)")  # they may fill the view
        expect(max(page.value(LOOK)["corner"]) < 90, "dark mode has a light background")
        width = page.value("document.documentElement.scrollWidth")
        expect(width <= 1366, f"{width} pixels wide on a laptop")
        expect(not page.problems, f"problems in dark mode: {page.problems}")
    return faults


if __name__ == "__main__":
    if browser.PROGRAM is None:
        print("skipped: chromium is not installed (CMake/packages.sh test)")
        sys.exit(0)
    found = check(sys.argv[1])
    print(*found, sep="\n", end="\n" if found else "")
    sys.exit(1 if found else 0)
