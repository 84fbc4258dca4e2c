#!/usr/bin/env python3
"""Loads pages of `vdf report --html` in headless Chromium and fails if something is wrong with them.

Each page is looked at on a desktop and on a phone, light and dark. It fails on messages of the console,
on any request but for the page itself, on text that overlaps other text, leaves its plot or is too faint,
and on a page that is wider than the screen.
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


def problems_of(browser, path, screen, scheme, screenshot):
    width, height = SCREENS[screen]
    context = browser.new_context(viewport={"width": width, "height": height}, color_scheme=scheme)
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
