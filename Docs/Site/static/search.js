// Finds the sections of the site that have all words of a query, and shows them by pages, with excerpts. conf.py writes
// kSections: [address, title of the page, heading, text]. Testing/Documentation/search.js runs findPages() without a page.
"use strict";

const kWeights = [[/^reference\//, 0.5], [/^(Docs\/Algorithms|Docs\/Architecture)\b/, 0.6],
                  [/^(Examples|Docs\/Notes|Docs\/Map|Data|CHANGELOG|CONTRIBUTING|README)\b/, 0.3]];
const kLength = 240;  // characters of an excerpt
const kAmerican = {license: "licence", color: "colour", center: "centre", meter: "metre", neighbor: "neighbour"};

/// The part of a word that its forms share: "tunnelling" and "tunnels" have "tunnel".
function stemOf(word) {
  const british = kAmerican[word.replace(/s$/, "")] ?? word;
  const stem = british.replace(/(ies|ing|ed|es|s|e|y)$/, "");
  if (stem.length < 3) return british;
  return stem.replace(/([^aeious])\1$/, "$1");
}

/// Words of a query as expressions. They match where a word begins, also one within a name: "field" in addDistanceField.
function expressionsOf(query) {
  const words = query.match(/[\p{L}\p{N}_]+/gu) ?? [];
  return [...new Set(words.map((word) => stemOf(word.toLowerCase())))].map((stem) => {
    const capital = stem[0].toUpperCase() + stem.slice(1);
    const any = [...stem].map((c) => `[${c}${c.toUpperCase()}]`).join("");
    return new RegExp(`(?<![\\p{L}\\p{N}])${any}[\\p{L}\\p{N}]*|(?<=\\p{Ll})${capital}\\p{L}*`, "gu");
  });
}

const countIn = (text, expression) => (text.match(expression) ?? []).length;

/// The part of a text with most words of the query, and where these are in it.
function excerptOf(text, expressions) {
  const places = expressions.flatMap((expression, word) => [...text.matchAll(expression)].map((match) =>
      ({word, start: match.index, end: match.index + match[0].length}))).sort((a, b) => a.start - b.start);
  let best = {words: 0, start: 0};
  for (const place of places) {
    const near = places.filter((each) => each.start >= place.start && each.end <= place.start + kLength);
    const words = new Set(near.map((each) => each.word)).size;
    if (words > best.words) best = {words, start: place.start};
  }
  const wanted = Math.max(best.start - 60, 0);
  const start = wanted === 0 ? 0 : text.indexOf(" ", wanted) + 1;
  const full = text.slice(start, start + kLength), cut = start + kLength < text.length;
  const end = start + (cut ? Math.max(full.lastIndexOf(" "), 1) : full.length);
  return {text: text.slice(start, end), before: start > 0, after: cut,
          marks: places.filter((each) => each.start >= start && each.end <= end)
                     .map((each) => [each.start - start, each.end - start])};
}

/// Pages with sections that have all words, the best first: {title, sections: [{address, heading, score, excerpt()}]}.
/// Where no section has all of them, those of pages that have them all, else sections with any word.
function findPages(query) {
  const expressions = expressionsOf(query);
  if (!expressions.length) return [];
  const rows = kSections.map(([address, title, heading, text]) => ({
    address, title, heading, text,
    counts: expressions.map((each) => countIn(text, each)),
    inHeading: expressions.map((each) => countIn(heading, each) > 0),
    inTitle: expressions.map((each) => countIn(title, each) > 0)}));
  const has = (row, i) => row.counts[i] > 0 || row.inHeading[i] || row.inTitle[i];
  const rarity = expressions.map((_, i) => Math.log(1 + rows.length / (1 + rows.filter((row) => has(row, i)).length)));
  const joined = query.trim().toLowerCase().replace(/[^\p{L}\p{N}]+/gu, "[^\\p{L}\\p{N}]?");
  const phrase = expressions.length > 1 ? new RegExp(joined, "iu") : null;
  for (const row of rows) {
    row.score = expressions.reduce((sum, _, i) => sum + rarity[i] * (row.counts[i] / (row.counts[i] + 2) +
        (row.inHeading[i] ? 2 : 0) + (row.inTitle[i] ? (row.heading ? 1 : 3) : 0)), 0);
    if (phrase && phrase.test(`${row.title} ${row.heading} ${row.text}`)) row.score *= 2;
    row.score *= kWeights.find(([pattern]) => pattern.test(row.address))?.[1] ?? 1;
  }
  const pageOf = (row) => row.address.replace(/#.*/, "");
  const wordsOfPages = {};
  for (const row of rows) expressions.forEach((_, i) => {
    if (has(row, i)) (wordsOfPages[pageOf(row)] ??= new Set()).add(i);
  });
  const all = expressions.map((_, i) => i);
  let found = rows.filter((row) => all.every((i) => has(row, i)) && all.some((i) => row.counts[i] > 0 || row.inHeading[i] || !row.heading));
  if (!found.length)
    found = rows.filter((row) => row.score > 0 && wordsOfPages[pageOf(row)].size === all.length);
  if (!found.length) found = rows.filter((row) => row.score > 0);
  const pages = new Map();
  for (const row of found.sort((a, b) => b.score - a.score)) {
    if (!pages.has(pageOf(row))) pages.set(pageOf(row), {title: row.title, sections: []});
    pages.get(pageOf(row)).sections.push({address: row.address, heading: row.heading, score: row.score,
                                          excerpt: () => excerptOf(row.text, expressions)});
  }
  return [...pages.values()];
}

/// Adds an element with text to a parent, and returns it.
function add(parent, tag, text = "", properties = {}) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(text);
  parent.append(element);
  return element;
}

function show(query, place) {
  const pages = findPages(query);
  add(place, "p", pages.length ? `${pages.length} pages for “${query}”.` : `No page has “${query}”.`);
  for (const {title, sections} of pages.slice(0, 30)) {
    const item = add(place, "div", "", {className: "found"}), best = sections[0];
    add(item, "a", title + (best.heading ? ` › ${best.heading}` : ""), {href: best.address});
    const {text, marks, before, after} = best.excerpt();
    if (text) {
      const line = add(item, "p", before ? "… " : "");
      let end = 0;
      for (const [from, to] of marks.filter(([from], i) => i === 0 || from >= marks[i - 1][1])) {
        line.append(text.slice(end, from));
        add(line, "mark", text.slice(from, to));
        end = to;
      }
      line.append(text.slice(end) + (after ? " …" : ""));
    }
    if (sections.length === 1) continue;
    const more = add(item, "p", "Also: ", {className: "more"});
    sections.slice(1, 5).forEach((each, i) => {
      if (i > 0) more.append(" · ");
      add(more, "a", each.heading || title, {href: each.address});
    });
  }
}

if (typeof document !== "undefined") {
  const query = new URLSearchParams(window.location.search).get("q") ?? "";
  for (const field of document.querySelectorAll('input[name="q"]')) field.value = query;
  if (query) show(query, document.getElementById("search-results"));
}
