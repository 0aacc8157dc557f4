#!/usr/bin/env python3
"""mutation.py [OPTION...]: plants faults in a copy of Source, and shows which of them tests notice.

All faults are compiled into one build, and the environment variable PALPATE_FAULT selects one. First each test runs
alone and without a fault, which says which faults it evaluates. Then, for each fault, the tests that evaluate it run
until one fails: first the test that noticed it before, then the quick tests that noticed many faults of its module.
Outcomes are appended to a file. A later call continues after them, and repeats a fault if its test is gone.
"""
import argparse
import collections
import concurrent.futures
import contextlib
import csv
import functools
import hashlib
import json
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

from sites import File

ROOT = Path(__file__).resolve().parents[2]
MODULES = sorted(path.name for path in (ROOT / 'Source').iterdir() if any(path.glob('*.h')))
FOLDERS = [f'Unit/{module}' for module in MODULES if (ROOT / 'Testing' / 'Unit' / module).is_dir()]
BINARIES = [folder.replace('/', '') for folder in FOLDERS] + ['Frame', 'ExactGeometryTypes', 'Golden']
FOLDERS += ['Frame', 'Exact', 'Golden']
ARGUMENTS = {'Golden': [ROOT / 'Data' / 'Golden.txt']}  # of a binary that is one test, without GoogleTest
PARTS = ['module', 'file']  # of a fault, for which tests that notice faults are counted
KINDS = ['comparison', 'off by one', 'bound', 'sign', 'logic', 'minimum or maximum']
PER_MODULE = 52  # faults that are planted in each module, before those that do not compile are taken out
SELECTOR = 'Core/PlantedFault.h'
PLACE = re.compile(r'Source/(\S+?):(\d+):\d+: ')
BATCHES = [0.2, 1.0, 3.0]  # seconds without a fault up to which each batch of tests reaches, and then --seconds
# One SIMD path builds in less time. Assertions and range checks of the standard library notice more.
OPTIONS = ['-DCMAKE_BUILD_TYPE=Release',
           '-DCMAKE_CXX_FLAGS_RELEASE=-O1 -DNDEBUG -w -DPALPATE_ASSERTIONS -D_GLIBCXX_ASSERTIONS',
           '-DPALPATE_PRECOMPILED_HEADERS=ON', '-DPALPATE_UNITY=ON', '-DPALPATE_UNITY_TESTS=ON',
           '-DPALPATE_SIMD_NATIVE=ON', '-DPALPATE_TEST_SHARDS=1', '-DPALPATE_TEST_FOLDERS=' + ';'.join(FOLDERS),
           f"-DPALPATE_SHARED_DATA={ROOT.parent / 'shared' / 'data'}",
           *(f'-DPALPATE_WITH_{part}=OFF' for part in ['C', 'VTK', 'FCL', 'PYTHON']), '-DPALPATE_BUILD_EXAMPLES=OFF']


def evenly(items, count):
    """The order in which `count` of the items, evenly spaced, come first; the others follow."""
    chosen = [len(items) * i // count for i in range(min(count, len(items)))] if count else []
    return [items[i] for i in chosen + sorted(set(range(len(items))) - set(chosen))]


def shares(sizes, total):
    """Equal shares of the total for each kind, or as many as there are."""
    share = dict.fromkeys(sizes, 0)
    for _ in range(min(total, sum(sizes.values()))):
        share[min((kind for kind in sizes if share[kind] < sizes[kind]), key=share.get)] += 1
    return share


def unchanged():
    """Faults that change no result, as (file, kind, first line of source)."""
    lines = Path(__file__).with_name('unchanged.txt').read_text().splitlines()
    return {tuple(line.split(': ', 2)) for line in lines if re.match(r'\w+/\w+\.(h|cpp): ', line)}


def choose():
    """The faults: for each module equally many of each kind, evenly spaced over its files."""
    faults, left_out, matched = [], unchanged(), set()
    for module in MODULES:
        found = {kind: [] for kind in KINDS}
        for path in sorted((ROOT / 'Source' / module).glob('*.*')):
            file = File(path.read_text())
            name = str(path.relative_to(ROOT / 'Source'))
            for site in file.sites():
                source = file.text[file.text.rfind('\n', 0, site.start) + 1:].split('\n', 1)[0].strip()
                matched |= {(name, site.kind, source)} & left_out
                before = re.sub(r'\s*\n\s*', ' ', file.text[site.start:site.end])
                found[site.kind].append({
                    'module': module, 'file': name, 'line': file.text.count('\n', 0, site.start) + 1,
                    'lastLine': file.text.count('\n', 0, site.end) + 1, 'kind': site.kind, 'start': site.start,
                    'end': site.end, 'before': before, 'after': site.after,
                    'leftOut': (name, site.kind, source) in left_out})
        share = shares({kind: len(found[kind]) for kind in KINDS}, PER_MODULE)
        taken = {}
        for kind in sorted(KINDS, key=lambda k: len(found[k])):
            count = 0
            for fault in evenly(found[kind], share[kind]):
                ends = taken.setdefault(fault['file'], [])
                if count < share[kind] and not any(fault['start'] < b and a < fault['end'] for a, b in ends):
                    ends.append((fault['start'], fault['end']))
                    faults.append(fault)
                    count += 1
    if matched != left_out:
        sys.exit('unchanged.txt names faults that do not exist: ' + ', '.join(map(': '.join, left_out - matched)))
    # Strings and enumerators have no minus: those would not compile.
    faults = [f for f in faults if not (f['kind'] == 'sign' and '"' in f['before'] or
                                        f['kind'] == 'bound' and re.match(r'\w+::[A-Za-jl-z]\w*$', f['before']))]
    faults.sort(key=lambda f: (MODULES.index(f['module']), f['file'], f['start']))
    seen, ids = collections.Counter(), {0}
    for fault in faults:  # keys and ids stay when other faults change, so that outcomes stay, and less is built again
        name = '|'.join([fault['file'], fault['before'], fault['after']])
        seen[name] += 1
        fault['key'] = hashlib.sha256(f'{name}|{seen[name]}'.encode()).hexdigest()[:16]
        fault['id'] = next(i for k in range(1 << 16) if (i := int(fault['key'][:4], 16) + k & 0xffff) not in ids)
        ids.add(fault['id'])
    return faults


def write(path, text):
    """A file that does not change keeps its time, so that less is built again."""
    if not path.exists() or path.read_text() != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def plant(faults, tree):
    """Copies Source with the faults to the tree."""
    texts = {SELECTOR: """#pragma once
#include <cstdio>
#include <cstdlib>
namespace palpate {
struct PlantedFaults {
  int chosen = std::getenv("PALPATE_FAULT") ? std::atoi(std::getenv("PALPATE_FAULT")) : 0;
  bool evaluated[1 << 16] = {};
  ~PlantedFaults() {
    const char* name = std::getenv("PALPATE_EVALUATED");
    std::FILE* file = name ? std::fopen(name, "a") : nullptr;
    for (int i = 0; file && i < 1 << 16; ++i)
      if (evaluated[i]) std::fprintf(file, "%d\\n", i);
    if (file) std::fclose(file);
  }
};
inline PlantedFaults plantedFaults;
[[gnu::always_inline]] inline bool isPlanted(int id) {
  if (!plantedFaults.evaluated[id]) plantedFaults.evaluated[id] = true;
  return plantedFaults.chosen == id;
}
}  // namespace palpate
"""}
    for path in (ROOT / 'Source').rglob('*'):
        if path.is_file():
            texts[str(path.relative_to(ROOT / 'Source'))] = path.read_text()
    for name in sorted({f['file'] for f in faults}):
        text = texts[name]
        for fault in sorted((f for f in faults if f['file'] == name), key=lambda f: -f['start']):
            first, last = fault['start'], fault['end']
            lines = '\n' * text.count('\n', first, last)  # so that later lines keep their numbers
            text = f"{text[:first]}(::palpate::isPlanted({fault['id']}) ? {fault['after']} : " \
                   f"{fault['before']}){lines}{text[last:]}"
        texts[name] = f'#include "{SELECTOR}"\n#line 1\n{text}'
    for path in (tree / 'Source').rglob('*'):
        if path.is_file() and str(path.relative_to(tree / 'Source')) not in texts:
            path.unlink()
    for name, text in texts.items():
        write(tree / 'Source' / name, text)
    for path in ROOT.iterdir():
        if path.name not in ('Source', 'build', '.git') and not (tree / path.name).exists():
            (tree / path.name).symlink_to(path)


def refused_in(output, faults):
    """The faults at which the compiler's errors are, or at which its notes say that the errors arise."""
    refused = set()
    for part in output.split('FAILED: '):
        lines = part.splitlines()
        for pattern in (': error: ', ': note: ', ''):
            places = {(m.group(1), int(m.group(2))) for line in lines if pattern in line for m in PLACE.finditer(line)}
            own = {f['id'] for f in faults for name, line in places
                   if f['file'] == name and f['line'] <= line <= f['lastLine']}
            if own:
                refused |= own
                break
    return refused


def compile_all(faults, tree, build, jobs, parse, binaries):
    """Builds the tests. Takes out the faults that do not compile, until all others do."""
    def attempt(command, **options):
        nonlocal faults
        while True:
            plant(faults, tree)
            result = subprocess.run(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **options)
            if result.returncode == 0:
                return
            (build / 'errors.txt').write_text(result.stdout)
            refused = refused_in(result.stdout, faults)
            if not refused:
                sys.exit(f'The build fails, but not at a planted fault: see {build}/errors.txt')
            print(f'{len(refused)} of {len(faults)} faults do not compile', flush=True)
            faults = [f for f in faults if f['id'] not in refused]

    plant(faults, tree)
    if not (build / 'build.ninja').exists():
        subprocess.check_output(['cmake', '-G', 'Ninja', '-S', tree, '-B', build, *OPTIONS])
    if parse:
        # Sources are parsed first: a fault in a header that does not compile would build much again.
        commands = [c for c in json.loads((build / 'compile_commands.json').read_text())
                    if '/build/Source/' in c['file'] and 'cmake_pch' not in c['file']]
        headers = {os.path.relpath(h, build) for c in commands for h in re.findall(r'-include (\S+)', c['command'])}
        subprocess.check_output(['ninja', '-C', build, *(f'{header}.gch' for header in headers)])
        for c in commands:
            attempt(c['command'] + ' -fsyntax-only', shell=True, cwd=c['directory'])
    attempt(['ninja', '-C', build, '-k', '0', '-j', str(jobs), *binaries])
    return faults


def prepare(folder, jobs, binaries):
    """The faults in the build, which is made again if Source or this script changed."""
    state = hashlib.sha256(b''.join(path.read_bytes() for path in sorted(
        [*(ROOT / 'Source').rglob('*.*'), Path(__file__).with_name('sites.py')]) if path.is_file())).hexdigest()
    kept = folder / 'refused.json'
    stored = json.loads(kept.read_text()) if kept.exists() else {}
    refused = stored['refused'] if stored.get('state') == state else []
    chosen = choose()
    faults = compile_all([f for f in chosen if f['key'] not in refused], folder / 'tree', folder / 'build', jobs,
                         parse=stored.get('state') != state, binaries=binaries)
    refused = sorted({f['key'] for f in chosen} - {f['key'] for f in faults})
    kept.write_text(json.dumps({'state': state, 'refused': refused}))
    return [f for f in faults if not f['leftOut']]


@functools.cache
def path_of(binary, build):
    return next(path for path in (build / 'Testing').rglob(binary) if path.is_file())


def run(build, tests, seconds, **environment):
    """Runs tests of one binary until one fails. Returns its name, how it ended, and the seconds of processor time."""
    binary = tests[0].split('.')[0]

    def restrict():
        os.setsid()
        for limit, most in [('CPU', int(seconds) + 1), ('AS', 8 << 30), ('CORE', 0), ('FSIZE', 1 << 26)]:
            resource.setrlimit(getattr(resource, f'RLIMIT_{limit}'), (most, most))

    with tempfile.TemporaryFile() as output:
        command = [path_of(binary, build), *ARGUMENTS.get(binary, [
            '--gtest_fail_fast', '--gtest_filter=' + ':'.join(test.split('.', 1)[1] for test in tests)])]
        process = subprocess.Popen(command, preexec_fn=restrict, stdout=output, stderr=subprocess.STDOUT,
                                   env=os.environ | environment)

        def end():
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)

        timer = threading.Timer(20 + 8 * seconds, end)  # for tests that wait forever
        timer.start()
        _, status, usage = os.wait4(process.pid, 0)
        timer.cancel()
        end()
        process.returncode = code = os.waitstatus_to_exitcode(status)
        spent = usage.ru_utime + usage.ru_stime
        if code == 0:
            return '', '', spent
        output.seek(max(0, output.seek(0, 2) - 100_000))
        text = output.read().decode(errors='replace')
    started = re.findall(r'^\[ RUN      \] (\S+)', text, re.M)
    failed = re.findall(r'^\[  FAILED  \] (\S+?)(?:,|$| \()', text, re.M)
    ended = '' if failed else 'time' if code in (-signal.SIGXCPU, -signal.SIGKILL) else f'exit {code}'
    return f"{binary}.{(failed[:1] or started[-1:] or [''])[0]}", ended, spent


def names_of_tests(build, binaries):
    """All tests, each with its binary's name before it as ctest has them."""
    names = [f'{binary}.' for binary in binaries if binary in ARGUMENTS]
    for binary in (b for b in binaries if b not in ARGUMENTS):
        listed = subprocess.check_output([path_of(binary, build), '--gtest_list_tests'], text=True)
        for suite, tests in re.findall(r'^(\S+\.).*\n((?:  .*\n)+)', listed, re.M):
            names += [f'{binary}.{suite}{test}' for test in re.findall(r'^  (\S+)', tests, re.M)]
    return names


def measure(names, build, folder, longest, jobs):
    """Seconds of each test without a fault, and the faults that it evaluates. A later call measures new tests only."""
    kept = folder / 'tests.json'
    measured = json.loads(kept.read_text()) if kept.exists() else {}

    def measure_one(name):
        with tempfile.NamedTemporaryFile('r') as evaluated:
            failed, ended, seconds = run(build, [name], longest, PALPATE_EVALUATED=evaluated.name)
            measured[name] = [round(seconds, 3), [] if failed else sorted(map(int, set(evaluated.read().split())))]
        if failed:
            print(f'not run ({ended or "it fails without a fault"}): {name}', flush=True)

    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:  # those that took too long before are measured again
        list(pool.map(measure_one, (n for n in names if n not in measured or
                                    not measured[n][1] and 1 < measured[n][0] < longest)))
    kept.write_text(json.dumps(measured))
    return {name: (measured[name][0], set(measured[name][1])) for name in names
            if measured[name][1] and measured[name][0] <= longest + 1}


def batches(fault, tests, hits, before, most_seconds):
    """The tests that evaluate the fault: the one that noticed it before, then quick tests that noticed many."""
    able = [n for n in tests if fault['id'] in tests[n][1]] or tests  # a child process may evaluate it, too
    able, result, spent = {n: tests[n][0] for n in able}, [[] for _ in [*BATCHES, most_seconds]], 0.0
    worth = {n: 1 + hits[fault['module'], n] + 4 * hits[fault['file'], n] + 4 * n.startswith(f"Unit{fault['module']}.")
             for n in able}
    for name in sorted(able, key=lambda n: (n != before, able[n] / worth[n])):
        spent += able[name]
        if spent <= most_seconds or name == before:
            result[0 if name == before else sum(spent > most for most in BATCHES)].append(name)
    for batch in result:
        for binary in dict.fromkeys(name.split('.')[0] for name in batch):
            own = [name for name in batch if name.split('.')[0] == binary]
            yield own, sum(able[name] for name in own)


def outcome(fault, build, tests, hits, before, most_seconds):
    """Which test notices the fault, how it ends, and the seconds of all that ran."""
    total, noticed, ended = 0.0, '', ''
    for batch, seconds in batches(fault, tests, hits, before, most_seconds):
        noticed, ended, spent = run(build, batch, 2 + 3 * seconds, PALPATE_FAULT=str(fault['id']))
        total += spent
        # A test that depends on the machine's other work fails once.
        if noticed and (ended or run(build, [noticed], 2 + 3 * seconds, PALPATE_FAULT=str(fault['id']))[0]):
            hits.update((fault[part], noticed) for part in PARTS)
            break
        noticed = ''
    return {'key': fault['key'], 'test': noticed, 'ended': ended, 'seconds': f'{total:.2f}'}


def table(faults, outcomes):
    known = [f for f in faults if f['key'] in outcomes]
    for title, names in [('module', MODULES), ('kind', KINDS)]:
        print(f'\n| {title} | planted | noticed | share |\n|---|---:|---:|---:|')
        for name in [*names, 'all']:
            own = [f for f in known if name in (f[title], 'all')]
            noticed = sum(outcomes[f['key']]['test'] != '' for f in own)
            print(f'| {name} | {len(own)} | {noticed} | {100 * noticed / max(1, len(own)):.1f} % |')
    print('\nNo test notices:', *(described(f) for f in known if not outcomes[f['key']]['test']), sep='\n  ')


def described(fault):
    return f"Source/{fault['file']}:{fault['line']}: {fault['kind']}: {fault['before']}  ->  {fault['after']}"


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument('--list', action='store_true', help='only print the faults')
    arguments.add_argument('--again', action='store_true', help='repeat the faults that no test noticed')
    arguments.add_argument('--all', action='store_true', help='repeat all faults')
    arguments.add_argument('--modules', type=lambda text: text.split(','), default=MODULES, help='of faults: A,B')
    arguments.add_argument('--tests', type=lambda text: text.split(','), default=BINARIES, help='binaries: UnitA,Frame')
    arguments.add_argument('--seconds', type=float, default=15.0,
                           help='of tests for each fault at most, and three times that of the longest test')
    arguments.add_argument('--build', type=Path, default=ROOT / 'build' / 'mutation', help='folder for all files')
    arguments.add_argument('--jobs', type=int, default=os.cpu_count())
    given = arguments.parse_args()
    if given.list:
        return print('\n'.join(map(described, choose())))

    folder = given.build.resolve()
    (folder / 'build').mkdir(parents=True, exist_ok=True)
    faults, build = prepare(folder, given.jobs, given.tests), folder / 'build'
    print(f'{len(faults)} faults are planted', flush=True)
    store = folder / 'outcomes.csv'
    outcomes = {row['key']: row for row in csv.DictReader(store.open())} if store.exists() else {}
    names = set(names_of_tests(build, given.tests))
    noticed = {key: row['test'] for key, row in outcomes.items() if row['test']}
    open_faults = [f for f in faults if f['module'] in given.modules and (
        given.all or noticed.get(f['key']) not in names and
        (given.again or f['key'] not in outcomes or f['key'] in noticed))]
    open_faults.sort(key=lambda f: f['key'])  # so that some outcomes of all modules are there early
    tests = measure(sorted(names), build, folder, given.seconds / 3, given.jobs) if open_faults else {}
    hits = collections.Counter((f[part], noticed[f['key']]) for f in faults if f['key'] in noticed for part in PARTS)
    with store.open('a', newline='') as file:
        writer = csv.DictWriter(file, ['key', 'test', 'ended', 'seconds'])
        if file.tell() == 0:
            writer.writeheader()
        with concurrent.futures.ThreadPoolExecutor(given.jobs) as pool:
            for row in pool.map(
                    lambda f: outcome(f, build, tests, hits, noticed.get(f['key']), given.seconds), open_faults):
                outcomes[row['key']] = row
                writer.writerow(row)
                file.flush()
    table(faults, outcomes)


if __name__ == '__main__':
    main()
