#!/usr/bin/env python3
"""mutation.py [OPTION...]: plants faults in a copy of Source, and shows which of them unit tests notice.

All faults are compiled into one build, and the environment variable PALPATE_FAULT selects one. The tests of a module
are linked with its planted files; the other modules come from the library of a release build. For each fault the tests
of its module run until one fails; the quickest run first. Outcomes are appended to a file, and a later call continues
after them.
"""
import argparse
import concurrent.futures
import csv
import hashlib
import json
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from sites import File

ROOT = Path(__file__).resolve().parents[2]
MODULES = ['Exact', 'Math', 'Octree', 'Contact', 'NarrowPhase', 'Queries']
KINDS = ['comparison', 'off by one', 'bound', 'sign', 'logic', 'minimum or maximum']
PER_MODULE = 84  # faults that are planted in each module, before those that do not compile are taken out
REQUIRED = 300
SELECTOR = 'Core/PlantedFault.h'
PLACE = re.compile(r'Source/(\S+?):(\d+):\d+: ')
MEMORY = 8 << 30  # bytes of address space of a test
# Fewer SIMD paths build in less time; range checks of the standard library notice more.
FLAGS = "-std=c++20 -O1 -w -DNDEBUG -fPIE -ffp-contract=off -fvisibility=hidden -fvisibility-inlines-hidden $\n" \
        "  -D_GLIBCXX_ASSERTIONS -DPALPATE_THREADS_STD -DHWY_SHARED_DEFINE $\n" \
        "  '-DHWY_DISABLED_TARGETS=(HWY_SSSE3|HWY_SSE4|HWY_AVX3|HWY_AVX3_DL)'"
BATCHES = [1.0, 5.0]  # seconds without a fault of the first batches of tests; the last batch has the rest


def evenly(items, count):
    """The order in which `count` of the items, evenly spaced, come first; the others follow."""
    chosen = [len(items) * i // count for i in range(min(count, len(items)))] if count else []
    rest = sorted(set(range(len(items))) - set(chosen))
    return [items[i] for i in chosen + rest]


def shares(sizes, total):
    """Equal shares of the total for each kind, or as many as there are."""
    share = dict.fromkeys(sizes, 0)
    for _ in range(total):
        open_kinds = [k for k in sizes if share[k] < sizes[k]]
        if not open_kinds:
            break
        share[min(open_kinds, key=lambda k: share[k])] += 1
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
        for path in sorted((ROOT / 'Source' / module).iterdir()):
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
                ranges = taken.setdefault(fault['file'], [])
                if count == share[kind]:
                    break
                if fault['leftOut'] or any(fault['start'] < end and start < fault['end'] for start, end in ranges):
                    continue
                ranges.append((fault['start'], fault['end']))
                faults.append(fault)
                count += 1
    if matched != left_out:
        sys.exit('unchanged.txt names faults that do not exist: ' + '; '.join(map(': '.join, sorted(left_out - matched))))
    faults.sort(key=lambda f: (MODULES.index(f['module']), f['file'], f['start']))
    for fault in faults:
        fault['key'] = hashlib.sha256('|'.join(
            [fault['file'], str(fault['start']), fault['before'], fault['after']]).encode()).hexdigest()[:16]
        fault['id'] = int(fault['key'][:7], 16)  # stays when other faults are left out, so that less is built again
    return faults


def write(path, text):
    """A file that does not change keeps its time, so that less is built again."""
    if not path.exists() or path.read_text() != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def plant(faults, tree):
    """Copies Source with the faults to the tree."""
    selector = '#pragma once\n#include <cstdlib>\nnamespace palpate {\n' \
               'inline const int plantedFault = [] {\n  const char* id = std::getenv("PALPATE_FAULT");\n' \
               '  return id ? std::atoi(id) : 0;\n}();\n}  // namespace palpate\n'
    texts = {SELECTOR: selector}
    for path in (ROOT / 'Source').rglob('*'):
        if path.is_file():
            texts[str(path.relative_to(ROOT / 'Source'))] = path.read_text()
    for name in sorted({f['file'] for f in faults}):
        text = texts[name]
        for fault in sorted((f for f in faults if f['file'] == name), key=lambda f: -f['start']):
            first, last = fault['start'], fault['end']
            lines = '\n' * text.count('\n', first, last)  # so that later lines keep their numbers
            text = f"{text[:first]}(::palpate::plantedFault == {fault['id']} ? {fault['after']} : " \
                   f"{fault['before']}){lines}{text[last:]}"
        texts[name] = f'#include "{SELECTOR}"\n#line 1\n{text}'
    for name, text in texts.items():
        write(tree / 'Source' / name, text)


def configure(tree, build, library):
    """Writes the Ninja file. Each test binary has the planted files of its module; the library has the others."""
    packages = subprocess.run(['pkg-config', '--cflags', 'eigen3', 'gmpxx', 'libhwy'], text=True, check=True,
                              stdout=subprocess.PIPE).stdout.strip()
    data, testing = ROOT.parent / 'shared' / 'data', ROOT / 'Testing'
    launcher = os.environ.get('CMAKE_CXX_COMPILER_LAUNCHER', '')
    headers = build / 'precompiled.h'
    write(headers, ''.join(f'#include <{h}>\n' for h in [
        'gtest/gtest.h', 'Eigen/Core', 'Eigen/Geometry', 'algorithm', 'array', 'cmath', 'functional', 'map', 'memory',
        'random', 'set', 'span', 'string', 'vector']))
    text = f"""flags = {FLAGS} -I{tree}/Source -I{tree}/Source/Public -I{tree}/Source/Simplify/Public -I{testing} -I{ROOT}/Examples/Common {packages} $
  -DPALPATE_SHARED_DATA='"{data}"' -DPALPATE_SOURCE_DIR='"{ROOT}"'
rule precompile
  command = c++ $flags -x c++-header -c $in -o $out
rule compile
  command = {launcher} c++ $flags -include {headers} -MD -MF $out.d -c $in -o $out
  depfile = $out.d
rule link
  command = c++ $in {library}/Examples/Common/libPalpateScenes.a {library}/Source/libPalpateInternal.a $
    -lgtest -lgtest_main -lhwy -lmeshoptimizer -lgmpxx -lgmp -lpthread -o $out
build {headers}.gch: precompile {headers}
"""
    for module in MODULES:
        sources = sorted((ROOT / 'Source' / module).glob('*.cpp'))
        files = [tree / 'Source' / module / source.name for source in sources]
        files += sorted((testing / 'Unit' / module).glob('*Test.cpp')) + [testing / 'Common' / 'FailingAllocation.cpp']
        objects = [f'{module}/{file.stem}.o' for file in files]
        for file, made in zip(files, objects):
            text += f'build {made}: compile {file} | {headers}.gch\n'
        text += f"build Unit{module}: link {' '.join(objects)}\n"
    (build / 'build.ninja').write_text(text)


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


def check_headers(faults, tree):
    """Takes out the faults in headers that do not compile, before many files include them."""
    headers = {f['file'] for f in faults if f['file'].endswith('.h')}
    headers = sorted(h for h in headers if '#pragma once' in (ROOT / 'Source' / h).read_text())
    eigen = subprocess.run(['pkg-config', '--cflags', 'eigen3'], text=True, stdout=subprocess.PIPE, check=True).stdout
    command = ['c++', '-std=c++20', '-fsyntax-only', '-x', 'c++', '-', f'-I{tree}/Source', f'-I{tree}/Source/Public', f'-I{tree}/Source/Simplify/Public',
               *eigen.split()]
    while True:
        plant(faults, tree)
        result = subprocess.run(command, input=''.join(f'#include "{h}"\n' for h in headers), text=True,
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        refused = refused_in(result.stdout, faults) if result.returncode else set()
        if not refused:
            return faults
        print(f'{len(refused)} of {len(faults)} faults do not compile', flush=True)
        faults = [f for f in faults if f['id'] not in refused]


def compile_all(faults, tree, build, jobs):
    """Builds the tests. Takes out the faults that do not compile, until all others do."""
    command = ['ninja', '-C', build, '-k', '0', '-j', str(jobs)] + [f'Unit{m}' for m in MODULES]
    while True:
        plant(faults, tree)
        result = subprocess.run(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        if result.returncode == 0:
            return faults
        (build / 'errors.txt').write_text(result.stdout)
        refused = refused_in(result.stdout, faults)
        if not refused:
            sys.exit(f'The build fails, but not at a planted fault: see {build}/errors.txt')
        print(f'{len(refused)} of {len(faults)} faults do not compile', flush=True)
        faults = [f for f in faults if f['id'] not in refused]


def prepare(folder, library, jobs):
    """The faults in the build, which is made again if Source or this script changed."""
    tree, build = folder / 'tree', folder / 'build'
    build.mkdir(parents=True, exist_ok=True)
    state = hashlib.sha256()
    for path in sorted((ROOT / 'Source').rglob('*')) + [Path(__file__).with_name('sites.py')]:
        if path.is_file():
            state.update(path.read_bytes())
    kept = folder / 'faults.json'
    stored = json.loads(kept.read_text()) if kept.exists() else {}
    refused = stored['refused'] if stored.get('state') == state.hexdigest() else []
    chosen = choose()
    faults = [f for f in chosen if f['key'] not in refused]
    if not stored or stored.get('state') != state.hexdigest():
        faults = check_headers(faults, tree)
    configure(tree, build, library)
    faults = compile_all(faults, tree, build, jobs)
    refused = sorted({f['key'] for f in chosen} - {f['key'] for f in faults})
    kept.write_text(json.dumps({'state': state.hexdigest(), 'refused': refused}))
    return faults, build


def run(binary, fault, tests, limit):
    """Runs tests until one fails. Returns (noticed, by which test)."""
    def restrict():
        os.setsid()
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 26, 1 << 26))

    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(
            [binary, '--gtest_fail_fast', '--gtest_filter=' + ':'.join(tests)], preexec_fn=restrict, stdout=output,
            stderr=subprocess.STDOUT, env=os.environ | {'PALPATE_FAULT': str(fault)})
        try:
            code = process.wait(limit)
        except subprocess.TimeoutExpired:
            code = 'time'
        finally:
            try:
                os.killpg(process.pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
        process.wait()
        if code == 0:
            return False, ''
        output.seek(max(0, output.seek(0, 2) - 100_000))
        text = output.read().decode(errors='replace')
    started = re.findall(r'^\[ RUN      \] (\S+)', text, re.M)
    failed = re.findall(r'^\[  FAILED  \] (\S+?)(?:,|$| \()', text, re.M)
    test = failed[0] if failed else started[-1] if started else ''
    return True, test + ('' if failed else ' (time)' if code == 'time' else f' (exit {code})')


def baseline(build, folder):
    """Seconds of each test of each module, without a fault."""
    times = {}
    for module in MODULES:
        report = folder / f'{module}.json'
        binary = build / f'Unit{module}'
        begin = time.time()
        result = subprocess.run([binary, f'--gtest_output=json:{report}', '--gtest_brief=1'], text=True,
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        if result.returncode != 0:
            sys.exit(f'{binary} fails without a fault:\n{result.stdout[-3000:]}')
        times[module] = {f"{suite['name']}.{test['name']}": float(test['time'].rstrip('s'))
                         for suite in json.loads(report.read_text())['testsuites'] for test in suite['testsuite']
                         if test.get('result') != 'SKIPPED'}
        print(f'{module}: {len(times[module])} tests, {time.time() - begin:.1f} s without a fault', flush=True)
    return times


def batches(times):
    """Tests by time, the quickest first, in batches."""
    result, spent = [[] for _ in range(len(BATCHES) + 1)], 0.0
    for test, seconds in sorted(times.items(), key=lambda item: item[1]):
        spent += seconds
        result[next((i for i, most in enumerate(BATCHES) if spent <= most), len(BATCHES))].append(test)
    return [batch for batch in result if batch]


def outcome(fault, build, times):
    """Whether a test notices the fault, which one, and after how long. `times`: of the tests of its module."""
    begin, noticed, test = time.time(), False, ''
    for batch in batches(times):
        noticed, test = run(build / f"Unit{fault['module']}", fault['id'], batch, 10 + 5 * sum(times[t] for t in batch))
        if noticed:
            break
    return {'key': fault['key'], 'noticed': 'yes' if noticed else 'no', 'test': test,
            'seconds': f'{time.time() - begin:.2f}'}


def table(faults, outcomes):
    known = [f for f in faults if f['key'] in outcomes]
    print('\n| module | planted | noticed | share |\n|---|---:|---:|---:|')
    for name in MODULES + ['all']:
        own = [f for f in known if name in (f['module'], 'all')]
        noticed = sum(outcomes[f['key']]['noticed'] == 'yes' for f in own)
        print(f"| {name} | {len(own)} | {noticed} | {100 * noticed / max(1, len(own)):.1f} % |")
    print('\n| kind | planted | noticed |\n|---|---:|---:|')
    for kind in KINDS:
        own = [f for f in known if f['kind'] == kind]
        print(f"| {kind} | {len(own)} | {sum(outcomes[f['key']]['noticed'] == 'yes' for f in own)} |")
    print('\nNo test notices:')
    for f in known:
        if outcomes[f['key']]['noticed'] != 'yes':
            print(f"  Source/{f['file']}:{f['line']}: {f['kind']}: {f['before']}  ->  {f['after']}")


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument('--list', action='store_true', help='only print the faults')
    arguments.add_argument('--again', action='store_true', help='repeat the faults that no test noticed')
    arguments.add_argument('--build', type=Path, default=ROOT / 'build' / 'mutation',
                           help='folder of the build and of outcomes.csv')
    arguments.add_argument('--release', type=Path, default=ROOT / 'build' / 'release',
                           help='folder of a release build; build/release is brought up to date')
    arguments.add_argument('--jobs', type=int, default=os.cpu_count())
    given = arguments.parse_args()
    if given.list:
        faults = choose()
        for f in faults:
            print(f"Source/{f['file']}:{f['line']}: {f['kind']}: {f['before']}  ->  {f['after']}")
        print(f'{len(faults)} faults')
        return len(faults) < REQUIRED

    folder = given.build.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    if given.release == ROOT / 'build' / 'release':
        subprocess.run(['cmake', '--preset', 'release'], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
        subprocess.run(['cmake', '--build', '--preset', 'release', '--target', 'PalpateInternal', 'PalpateScenes', '-j',
                        str(given.jobs)], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    faults, build = prepare(folder, given.release.resolve(), given.jobs)
    print(f'{len(faults)} faults are planted', flush=True)
    store = folder / 'outcomes.csv'
    outcomes = {row['key']: row for row in csv.DictReader(store.open())} if store.exists() else {}
    open_faults = [f for f in faults if f['key'] not in outcomes or
                   given.again and outcomes[f['key']]['noticed'] != 'yes']
    times = baseline(build, folder) if open_faults else {}
    with store.open('a', newline='') as file:
        writer = csv.DictWriter(file, ['key', 'noticed', 'test', 'seconds'])
        if file.tell() == 0:
            writer.writeheader()
        with concurrent.futures.ThreadPoolExecutor(given.jobs) as pool:
            for row in pool.map(lambda fault: outcome(fault, build, times[fault['module']]), open_faults):
                outcomes[row['key']] = row
                writer.writerow(row)
                file.flush()
    table(faults, outcomes)
    return 0


if __name__ == '__main__':
    sys.exit(main())
