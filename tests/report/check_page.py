#!/usr/bin/env python3
"""Loads pages of `vdf report --html` in headless Chromium and fails if something is wrong with them.

Each page is looked at on a desktop and on a phone, light and dark. It fails on messages of the console,
on any request but for the page itself, on text that overlaps other text, leaves its plot or is too faint,
on a page that is wider than the screen, and on a slider that does not compare its pictures with mouse, finger
and keyboard, or hides one of them where scripts do not run.
"""

import argparse
import pathlib
import sys

from playwright.sync_api import sync_playwright

SCREENS = {"desktop": (1280, 900), "phone": (390, 844)}

# Rectangles of all lines of text, with what they say.
FIND_PROBLEMS = r"""
() => {
  const problems = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const lines = [];
  let order = 0;
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const text = node.textContent.trim();
    if (!text) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const r of range.getClientRects()) {
      if (r.width > 0 && r.height > 0) lines.push({text, order, l: r.left, r: r.right, t: r.top, b: r.bottom});
    }
    order += 1;
    const svg = node.parentElement.closest("svg");
    if (svg) {
      const s = svg.getBoundingClientRect(), q = range.getBoundingClientRect();
      if (q.left < s.left - 1 || q.right > s.right + 1 || q.top < s.top - 1 || q.bottom > s.bottom + 1)
        problems.push(`"${text}" leaves its plot`);
    }
  }
  lines.sort((a, b) => a.t - b.t);
  for (let i = 0; i < lines.length; i++) {
    for (let j = i + 1; j < lines.length && lines[j].t < lines[i].b; j++) {
      const [a, b] = [lines[i], lines[j]];
      const width = Math.min(a.r, b.r) - Math.max(a.l, b.l), height = Math.min(a.b, b.b) - b.t;
      // A line's box is higher than its letters; neighbours of one text may touch.
      if (a.order !== b.order && width > 1 && height > 3) problems.push(`"${a.text}" and "${b.text}" overlap`);
    }
  }
  if (document.documentElement.scrollWidth > window.innerWidth)
    problems.push(`the page is ${document.documentElement.scrollWidth} wide on a screen of ${window.innerWidth}`);
  // WCAG 2 contrast of text against the page, which is the only ground or nearly so.
  const luminance = (colour) => {
    const [r, g, b] = colour.match(/[\d.]+/g).map(Number).map((v) => {
      v /= 255;
      return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
    });
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const ground = luminance(getComputedStyle(document.body).backgroundColor);
  for (const selector of ["body", "td small", "svg text", ".good", ".bad", "dt"]) {
    const element = document.querySelector(selector);
    if (!element) continue;
    const style = getComputedStyle(element);
    const ink = luminance(element.closest("svg") ? style.fill : style.color);
    const contrast = (Math.max(ink, ground) + 0.05) / (Math.min(ink, ground) + 0.05);
    if (contrast < 4.5) problems.push(`${selector} has a contrast of ${contrast.toFixed(1)}`);
  }
  if (!lines.length) problems.push("there is no text");
  return problems;
}
"""


# Where the upper picture of each comparison is cut off, in per cent from the left, and whether its border is there.
CUTS = r"""
() => [...document.querySelectorAll(".compare")].map((figure) => {
  const pair = figure.querySelector(".pair"), upper = figure.querySelector(".over img");
  const clip = getComputedStyle(upper).clipPath.match(/inset\(0(?:px|%)? 0(?:px|%)? 0(?:px|%)? ([\d.]+)%\)/);
  const border = parseFloat(getComputedStyle(pair, "::after").marginLeft) + 1;
  return {cut: clip ? Number(clip[1]) : null, border: 100 * border / pair.getBoundingClientRect().width};
})
"""

BOXES = r"""
() => [...document.querySelectorAll(".compare")].map((figure) => [...figure.querySelectorAll("img, span, input")].map((e) => {
  const r = e.getBoundingClientRect();
  return {kind: e.localName, l: r.left, r: r.right, t: r.top, b: r.bottom, shown: r.width > 0 && r.height > 0};
}))
"""


def slider_problems(page, touch):
    problems = []
    cuts = lambda: page.evaluate(CUTS)

    def expect(what, n, wanted):
        found = cuts()[n]
        for name in ("cut", "border"):
            if found[name] is None or abs(found[name] - wanted) > 1.0:
                problems.append(f"slider {n}, {what}: {name} at {found[name]}, not {wanted}")

    for n, boxes in enumerate(page.evaluate(BOXES)):
        pictures = [b for b in boxes if b["kind"] == "img"]
        if any(abs(pictures[0][side] - pictures[1][side]) > 0.5 for side in "lrtb"):
            problems.append(f"slider {n}: the pictures are not one over the other")
        if pictures[0]["r"] - pictures[0]["l"] < 200:
            problems.append(f"slider {n}: the pictures are too small")
        if not all(b["shown"] for b in boxes):
            problems.append(f"slider {n}: something is not shown")
        thumb = next(b for b in boxes if b["kind"] == "input")
        if thumb["b"] - thumb["t"] < 40:
            problems.append(f"slider {n}: too low for a finger")
    for n in range(page.locator(".compare").count()):
        figure = page.locator(".compare").nth(n)
        slider, pair = figure.locator("input"), figure.locator(".pair")
        expect("at first", n, 50)
        slider.focus()
        if not page.evaluate("() => document.activeElement.matches('.compare input:focus-visible')"):
            problems.append(f"slider {n}: no focus to be seen")
        page.keyboard.press("ArrowRight")
        expect("arrow right", n, 51)
        page.keyboard.press("Home")
        expect("home", n, 0)
        page.keyboard.press("End")
        expect("end", n, 100)
        if slider.get_attribute("aria-valuetext") != "100 % from the left" or not slider.get_attribute("aria-label"):
            problems.append(f"slider {n}: says nothing to a screen reader")
        pair.scroll_into_view_if_needed()
        box = pair.bounding_box()
        x, y = box["x"] + 0.25 * box["width"], box["y"] + 0.4 * box["height"]
        if touch:
            page.touchscreen.tap(x, y)
            expect("tap", n, 25)
        else:
            page.mouse.move(x, y)
            page.mouse.down()
            page.mouse.move(x + 0.5 * box["width"], y, steps=5)
            expect("drag", n, 75)
            page.mouse.up()
            page.mouse.move(x, y)
            expect("after the drag", n, 75)
            if slider.input_value() != "75":
                problems.append(f"slider {n}: does not follow the picture")
        slider.fill("50")
        expect("back", n, 50)
    return problems


def scriptless_problems(page):
    """Both pictures of a comparison, with their labels, side by side; no slider."""
    problems = []
    for n, boxes in enumerate(page.evaluate(BOXES)):
        for box in boxes:
            if box["shown"] == (box["kind"] == "input"):
                problems.append(f"slider {n} without scripts: {box['kind']} is {'' if box['shown'] else 'not '}shown")
        a, b = [box for box in boxes if box["kind"] == "img"]
        if a["r"] > b["l"] + 0.5:
            problems.append(f"slider {n} without scripts: the pictures are not side by side")
    return problems


def problems_of(browser, path, screen, scheme, screenshot):
    width, height = SCREENS[screen]
    touch = screen == "phone"
    settings = {"viewport": {"width": width, "height": height}, "color_scheme": scheme, "has_touch": touch}
    context = browser.new_context(**settings)
    page = context.new_page()
    problems = []
    address = path.resolve().as_uri()
    page.on("console", lambda m: problems.append(f"console: {m.text}"))
    page.on("pageerror", lambda e: problems.append(f"error: {e}"))

    def request(r):
        if r.url != address and not r.url.startswith("data:"):
            problems.append(f"request: {r.url}")

    page.on("request", request)
    page.goto(address, wait_until="load")
    problems += page.evaluate(FIND_PROBLEMS)
    broken = page.evaluate("() => [...document.images].filter((i) => !i.naturalWidth).map((i) => i.alt)")
    problems += [f"image not shown: {alt}" for alt in broken]
    if screenshot:
        page.screenshot(path=screenshot / f"{path.stem}-{screen}-{scheme}.png", full_page=True)
    problems += slider_problems(page, touch)
    context.close()
    context = browser.new_context(**settings, java_script_enabled=False)
    page = context.new_page()
    page.goto(address, wait_until="load")
    problems += scriptless_problems(page)
    context.close()
    return problems


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pages", nargs="+", type=pathlib.Path)
    parser.add_argument("--screenshots", type=pathlib.Path, help="folder to write screenshots to")
    parser.add_argument("--chromium", default="/usr/bin/chromium", help="the browser")
    args = parser.parse_args()
    if args.screenshots:
        args.screenshots.mkdir(parents=True, exist_ok=True)
    found = 0
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=args.chromium, args=["--no-sandbox"])
        for path in args.pages:
            for screen in SCREENS:
                for scheme in ("light", "dark"):
                    problems = problems_of(browser, path, screen, scheme, args.screenshots)
                    found += len(problems)
                    print(f"{path} {screen} {scheme}: {len(problems)} problems")
                    for problem in problems[:20]:
                        print(f"  {problem}")
        browser.close()
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
