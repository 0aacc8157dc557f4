// search.js HTML: what a reader finds by the search of the site in the folder HTML. It runs the script and the sections
// of the page search.html. The expected page must be among the first three, and its excerpt must show a word of the query.
"use strict";
const fs = require("fs"), path = require("path"), vm = require("vm");

const kExpected = {
  "self collision": "Docs/HowTo/Organs", "self-collision": "Docs/HowTo/Organs", "cloth": "Docs/HowTo/Cloth",
  "tunnelling": "Docs/HowTo/Solvers", "tunneling": "Docs/HowTo/Solvers", "STL": "Docs/HowTo/Organs",
  "export": "Docs/HowTo/ParaView", "ParaView": "Docs/HowTo/ParaView", "friction": "Docs/HowTo/Solvers",
  "knot": "Docs/HowTo/Sutures", "units": "Docs/Concepts", "Python": "Docs/Python", "float": "Docs/Concepts",
  "force": "Docs/HowTo/Solvers", "profile": "Docs/HowTo/Profile", "crash": "Docs/HowTo/Debugging",
  "haptic rendering": "Docs/HowTo/Haptics", "soft body": "Docs/HowTo/Organs", "deformable": "Docs/HowTo/Organs",
  "continuous collision detection": "Docs/Concepts", "real time": "Docs/HowTo/Deadlines", "GPU": "Docs/Start",
  "multithreading": "Docs/Guarantees", "needle insertion": "Docs/HowTo/Paths", "signed distance": "Docs/HowTo/Queries",
  "licence": "Docs/Versioning", "license": "Docs/Versioning", "closestPoints": "reference/SpatialQueries",
};

const folder = path.join(process.argv[2], "_static");
const code = ["sections.js", "search.js"].map((file) => fs.readFileSync(path.join(folder, file), "utf8")).join("\n");
const findPages = vm.runInNewContext(`${code}\nfindPages`);

let failures = 0;
for (const [query, page] of Object.entries(kExpected)) {
  const found = findPages(query).slice(0, 3).map(({sections}) => sections[0]);
  const section = found.find(({address}) => address.split(".html")[0] === page);
  if (section && section.excerpt().marks.length) continue;
  ++failures;
  console.error(`search "${query}": ${section ? "no excerpt of " : ""}${page} is not among ${found.map((each) => each.address)}`);
}
if (findPages("zzyzx").length || findPages("").length) ++failures, console.error("search: finds what no page has");
console.log(`search: ${Object.keys(kExpected).length} queries, ${failures} failures`);
process.exitCode = failures ? 1 : 0;
