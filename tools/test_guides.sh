#!/bin/sh
# Runs every command of the guides (dataset_spec/guides/*.md), literally and in order, and checks the figures, files and
# lines of output that they state. Arguments name guides: tools/test_guides.sh harder_tasks
#
# - A block ```sh is run; a block ```toml or ```python is written to the file that its first line names (`# FILE.toml`).
# - A block that begins with `# Not run:` is listed as skipped.
# - A table below `<!-- figures: RESULT.json KEY... -->` states values of these keys; the first column replaces `{}` in
#   the file's name.
# - Files that the text names with their folder must exist afterwards; `<scene>` and the like stand for any name.
# - The code after the word "prints" must have been printed.
#
# MATEVAL names the command; by default it is the tests' build.
set -eu
cd "$(dirname "$0")/.."
if [ -z "${MATEVAL:-}" ]; then
    # Built with the tests' profile, so that nothing is compiled twice.
    cargo test --workspace --no-run --quiet
    MATEVAL="${CARGO_TARGET_DIR:-target}/debug/mateval"
fi
# The scripts of guides need NumPy.
tools/apt_install.sh python3-venv
venv="${CARGO_TARGET_DIR:-target}/independent"
tools/venv.sh python3.11 "$venv" tests/independent/requirements.txt
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/bin"
ln -s "$(realpath "$MATEVAL")" "$work/bin/mateval"
PATH="$work/bin:$(realpath "$venv")/bin:$PATH" python3 - "$work" "$@" <<'PY'
import json
import pathlib
import re
import resource
import subprocess
import sys

GUIDES = pathlib.Path("dataset_spec/guides")
# Each guide with the folder that it is followed in, the number of blocks that are run or written, of blocks that are
# skipped, and of figures. The keeper's guide starts from what the method's author hands in.
EXPECTED = {
    "dataset_maker": ("dataset_maker", 8, 0, 0),
    "harder_tasks": ("harder_tasks", 11, 1, 19),
    "method_author": ("author_and_keeper", 7, 0, 6),
    "leaderboard_keeper": ("author_and_keeper", 7, 2, 0),
    "your_own_room": ("your_own_room", 5, 0, 3),
    "measured_colours": ("measured_colours", 3, 0, 0),
}
TOLERANCE = 0.1  # of a figure, which has one decimal


def blocks(text):
    """Yields the line, language and content of each fenced block."""
    for found in re.finditer(r"^```(.*)\n((?:.*\n)*?)```$", text, re.MULTILINE):
        yield text.count("\n", 0, found.start()) + 1, found[1], found[2]


def script(guide, text):
    """The guide's blocks as one shell script, with the number of those in it and of those that are skipped."""
    parts, skipped = ["set -eu"], 0
    for line, language, content in blocks(text):
        first = content.splitlines()[0]
        if language == "text":
            continue
        if first.startswith("# Not run:"):
            print(f"{guide}.md:{line}: skipped ({first.removeprefix('# Not run:').strip()})")
            skipped += 1
            continue
        file = re.fullmatch(r"# (\w+\.(?:toml|py))", first)
        if language in ("toml", "python") and file:
            content = f"cat > {file[1]} <<'END_OF_BLOCK'\n{content}END_OF_BLOCK\n"
        elif language != "sh":
            sys.exit(f"{guide}.md:{line}: a block of '{language}' that is neither run, written nor marked as skipped")
        parts.append(f"echo '--- {guide}.md:{line}' >&2\n{content}")
    return "\n".join(parts), len(parts) - 1, skipped


def figures(text):
    """Yields the result's file, key and value of each figure that a table states."""
    for found in re.finditer(r"^<!-- figures: (\S+) (.*) -->\n+((?:\|.*\n)+)", text, re.MULTILINE):
        keys = found[2].split()
        for row in found[3].splitlines()[2:]:
            name, *values = [cell.strip(" `") for cell in row.strip("|").split("|")]
            if len(values) != len(keys):
                sys.exit(f"a row has {len(values)} values, and the comment above its table {len(keys)} keys: {row}")
            yield from ((found[1].replace("{}", name), key, float(value)) for key, value in zip(keys, values))


def unseen(text, folder, output):
    """Files that the text names and that do not exist in the folder, and lines that were not printed."""
    prose = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    for path in re.findall(r"`([\w.<>/-]+/[\w.<>-]+\.(?:csv|exr|glb|html|json|md|png|svg|toml|xml))`", prose):
        if not any(folder.glob("**/" + re.sub(r"<\w+>", "*", path))):
            yield f"the file '{path}' does not exist"
    for line in re.findall(r"\bprints\s+`([^`]+)`", prose):
        if line not in output:
            yield f"'{line}' was not printed"


def wrong(stated, folder, shift=0.0):
    """The figures that differ from the results by more than the tolerance. `shift` is added to each."""
    for file, key, value in stated:
        protocols = json.loads((folder / file).read_text())["protocols"].values()
        result = next(scores["summary"][key] for scores in protocols if key in scores["summary"])
        if abs(value + shift - result) > TOLERANCE:
            yield f"{file}, {key}: the guide states {value}, the result is {result:.2f}"


def cpu_seconds():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def follow(guide, work):
    name, *expected = EXPECTED[guide]
    text = (GUIDES / f"{guide}.md").read_text()
    folder = work / name
    folder.mkdir(exist_ok=True)
    commands, run, skipped = script(guide, text)
    stated = list(figures(text))
    if [run, skipped, len(stated)] != expected:
        sys.exit(f"{guide}.md: {run} blocks, {skipped} skipped, {len(stated)} figures; expected {expected}")
    before = cpu_seconds()
    done = subprocess.run(["sh", "-c", commands], cwd=folder, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{guide}.md: the last block above ended with exit code {done.returncode}")
    if faults := [*unseen(text, folder, done.stdout), *wrong(stated, folder)]:
        sys.exit(f"{guide}.md:\n" + "\n".join(faults))
    # The twins: figures that are off by half a decibel, a file and a line that do not exist.
    if len(list(wrong(stated, folder, 0.5))) != len(stated):
        sys.exit(f"{guide}.md: the comparison accepts other figures")
    if len(list(unseen("`dataset/<scene>/absent.png` prints `nothing of the kind`", folder, done.stdout))) != 2:
        sys.exit("the search accepts files and lines that do not exist")
    print(f"{guide}.md: {run} blocks, {len(stated)} figures, {cpu_seconds() - before:.0f} CPU s", flush=True)


def main(work, *names):
    if {path.stem for path in GUIDES.glob("*.md")} != set(EXPECTED):
        sys.exit(f"'{GUIDES}' and EXPECTED in this script list different guides")
    folders = {EXPECTED[name][0] for name in names or EXPECTED}
    for guide in EXPECTED:
        if EXPECTED[guide][0] in folders:
            follow(guide, pathlib.Path(work))


main(*sys.argv[1:])
PY
