# A recipe from thousands of houses on any number of nodes that share a file system: each batch of houses is searched by a
# job of its own, then the survey of all is written and its scenes are chosen. README.md here says how to run it.

from pathlib import Path

SOURCE = Path(config["source"]).absolute()
HOUSES = config["houses"]
OUT = Path(config.get("survey", "survey"))
STATE = Path(config.get("state", "state"))
MATEVAL = config.get("mateval", "mateval")
BATCH = int(config.get("batch", 20))
HERE = Path(workflow.basedir)

FILES = sorted(path.relative_to(SOURCE).as_posix() for path in (SOURCE / HOUSES).glob("*.json"))
BATCHES = {f"{at:06}": FILES[at : at + BATCH] for at in range(0, len(FILES), BATCH)}

# What a batch of houses may use. Retries double memory and minutes.
COST = {
    "search": {"threads": 4, "mem_mb": 4000, "runtime": 120},
    "survey": {"threads": 4, "mem_mb": 8000, "runtime": 240},
}
for step, cost in config.get("cost", {}).items():
    COST[step].update(cost)


def resource(step, name):
    return lambda wildcards, attempt: COST[step][name] * 2 ** (attempt - 1)


FOLDERS = " ".join(f"--{key} {config[key]}" for key in ["models", "textures", "cameras"] if key in config)
COMMAND = (
    f"env RAYON_NUM_THREADS={{threads}} {MATEVAL} prep survey {HOUSES} --source {SOURCE} {FOLDERS} --out {OUT} "
    + config.get("options", "")
)


rule all:
    input: STATE / "surveyed"


rule search:
    output: STATE / "search/{batch}"
    log: "logs/search/{batch}.log"
    threads: COST["search"]["threads"]
    resources: mem_mb=resource("search", "mem_mb"), runtime=resource("search", "runtime")
    params: houses=lambda wildcards: " ".join(f"--house {file}" for file in BATCHES[wildcards.batch])
    shell: f"{HERE}/run_step.sh {{output}} {{log}} '' -- {COMMAND} {{params.houses}}"


# Searches what no batch has, which is everything that failed there. Exit code 1 says that there are too few rooms.
rule survey:
    input: expand(STATE / "search/{batch}", batch=BATCHES)
    output: STATE / "surveyed"
    log: "logs/survey.log"
    threads: COST["survey"]["threads"]
    resources: mem_mb=resource("survey", "mem_mb"), runtime=resource("survey", "runtime")
    params: scenes=f"--scenes {config['scenes']}" if "scenes" in config else ""
    shell: f"{{{{ {COMMAND} --force {{params.scenes}} > {{log}} 2>&1 || test $? -eq 1; }}}} && tail -n 3 {{log}} > {{output}}"
