"""Checks a competition by Codabench's documentation.

Sources: docs.codabench.org, "Yaml Structure", "Competition Bundle Structure", "Leaderboard Functionality"; what the
documentation leaves open, such as files that may not be empty, and lengths, is that of codalab/codabench
(`competitions/unpackers/v2.py`, `leaderboards/models.py`).
"""

import datetime
import sys
from pathlib import Path
from typing import Any

import yaml

TOP = {
    "version", "title", "description", "image", "terms", "docker_image", "make_programs_available", "queue",
    "make_input_data_available", "enable_detailed_results", "pages", "tasks", "phases", "leaderboards", "fact_sheet",
}  # fmt: skip
PHASE = {
    "index", "name", "start", "tasks", "execution_time_limit", "max_submissions", "max_submissions_per_day",
    "accepts_only_result_submissions", "hide_output", "hide_score_output",
}  # fmt: skip
RULES = {"Add", "Add_And_Delete", "Add_And_Delete_Multiple", "Force_Last", "Force_Latest_Multiple", "Force_Best"}


def faults(*, bundle: Path, description: dict[str, Any]) -> list[str]:
    """What Codabench would refuse, or not do as the bundle means."""
    found: list[str] = []

    def want(holds: bool, what: str) -> None:
        if not holds:
            found.append(what)

    def is_text(file: str) -> bool:
        return (bundle / file).is_file() and bool((bundle / file).read_text().strip())

    want(description.get("version") == 2, "version is not 2")
    want(set(description) <= TOP, f"unknown keys {set(description) - TOP}")
    want(0 < len(description.get("title", "")) <= 256, "title")
    want((bundle / description.get("image", "none")).is_file(), "image")
    want(is_text(description.get("terms", "none")), "terms are empty")
    want(bool(description.get("pages")), "no pages")
    for page in description.get("pages", []):
        want(bool(page["title"]) and is_text(page["file"]), f"page {page}")
    tasks = {task["index"]: task for task in description.get("tasks", [])}
    want(len(tasks) == len(description.get("tasks", [])) > 0, "tasks share an index, or there are none")
    for task in tasks.values():
        want(bool(task["name"]) and (bundle / task["reference_data"]).is_dir(), f"reference data of {task}")
        program = bundle / task["scoring_program"]
        metadata = yaml.safe_load((program / "metadata.yaml").read_text())
        want(isinstance(metadata.get("command"), str), "the scoring program has no command")
        want((program / "score.sh").is_file(), "score.sh")
        # Codabench packs folders beside the folder above, under their own names.
        want("/" in task["reference_data"] and "/" in task["scoring_program"], "a folder at the top")
    for phase in description.get("phases", []):
        want(set(phase) <= PHASE, f"unknown keys {set(phase) - PHASE}")
        want(bool(phase["name"]) and isinstance(phase["start"], datetime.date), "name or start of a phase")
        want(set(phase["tasks"]) == set(tasks), "a phase names other tasks")
        want(isinstance(phase["execution_time_limit"], int), "execution_time_limit")
    want(bool(description.get("phases")), "no phases")
    want(len(description.get("leaderboards", [])) == 1, "not one leaderboard")
    for board in description.get("leaderboards", []):
        want(bool(board["title"]) and len(board["key"]) <= 36, "title or key of the leaderboard")
        want(board["submission_rule"] in RULES, "submission_rule")
        columns = board["columns"]
        want([column["index"] for column in columns] == list(range(len(columns))), "indexes of the columns")
        want(len({column["key"] for column in columns}) == len(columns) > 0, "keys of the columns")
        for column in columns:
            want(column["sorting"] in ("asc", "desc") and isinstance(column["precision"], int), f"{column}")
            want(len(column["title"]) <= 36 and len(column["key"]) <= 36 and "." not in column["key"], f"{column}")
    for key, question in description.get("fact_sheet", {}).items():
        want(question["key"] == key and " " not in key, f"question {key}")
        want(question["type"] in ("checkbox", "text", "select") and bool(question["title"]), f"question {key}")
        want({question["is_required"], question["is_on_leaderboard"]} <= {"true", "false"}, f"question {key}")
    return found


def main(*, bundle: Path, tasks: int) -> None:
    description = yaml.safe_load((bundle / "competition.yaml").read_text())
    found = faults(bundle=bundle, description=description)
    assert not found, found
    assert len(description["tasks"]) == tasks, description["tasks"]
    assert description["title"] and description["docker_image"] == "example/mateval:1", description
    # The twins: each change is a fault.
    leaderboard = {"leaderboard": description["leaderboards"], "leaderboards": []}
    for change in ({"version": 1}, {"terms": "pages/absent.md"}, {"tasks": []}, {"phases": []}, leaderboard):
        assert faults(bundle=bundle, description={**description, **change}), change
    print(f"{bundle}: {tasks} tasks, {len(description['leaderboards'][0]['columns'])} columns")


if __name__ == "__main__":
    main(bundle=Path(sys.argv[2]), tasks=int(sys.argv[3]))
