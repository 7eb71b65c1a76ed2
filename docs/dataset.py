"""Write the scenarios of a board as a data set for people without flexaxis.

    python docs/dataset.py [SUITE] [--seeds 1000:1005] [-o FOLDER]

The folder (by default results/SUITE) gets `samples.parquet`, a row a sample of every run with the
true parameters beside what sensors saw, the same runs as NetCDF-4 in `records/`, and
`croissant.json`, which describes both to the tools of machine learning (Croissant 1.0). The numbers
are those of `flexaxis simulate` on the same seeds. pyarrow is needed.
"""

import argparse
import hashlib
import json
from collections.abc import Iterator
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pandas as pd

from flexaxis.experiments.catalogue.find import select
from flexaxis.experiments.running.progress import progress
from flexaxis.sim.law_parameters import LAW_UNITS
from flexaxis.sim.parameters import PARAMETER_UNITS
from flexaxis.sim.record import Record
from flexaxis.sim.simulate import simulate

ROOT = Path(__file__).parents[1]
NAME = "samples.parquet"
# The context of Croissant 1.0, in which the words below are defined.
CONTEXT = {
    "@language": "en", "@vocab": "https://schema.org/", "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/", "rai": "http://mlcommons.org/croissant/RAI/",
    "dct": "http://purl.org/dc/terms/", "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    **{name: f"cr:{name}" for name in [
        "citeAs", "column", "equivalentProperty", "extract", "field", "fileObject",
        "fileProperty", "fileSet", "format", "includes", "isLiveDataset", "jsonPath", "key",
        "md5", "parentField", "path", "recordSet", "references", "regex", "repeated",
        "replace", "samplingRate", "separator", "source", "subField", "transform",
    ]},
}  # fmt: skip
UNITS = {**PARAMETER_UNITS, **LAW_UNITS}
SIGNALS = {
    "time": "time [s]",
    "torque": "torque command, held over the period that begins [N m]",
    "speed": "measured motor speed [rad/s]",
    "increment": "measured motor angle less the one before, over the period [rad/s]",
    "angle": "measured motor angle [rad]",
    "true_speed": "true motor speed [rad/s]",
}


def frame(record: Record) -> pd.DataFrame:
    """Return the samples of a record, a row each; what it has not is missing."""
    columns: dict[str, Any] = {"scenario": record.scenario["name"], "seed": record.seed}
    columns |= {name: getattr(record, name) for name in SIGNALS}
    truth = record.true_parameters
    assert truth is not None  # a simulation knows it
    columns |= {f"true_{n}": truth[:, i] for i, n in enumerate(record.parameter_names)}
    return pd.DataFrame(columns, index=range(len(record.time)))


def fields(samples: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Yield what Croissant says of each column."""
    kinds = {"i": "sc:Integer", "f": "sc:Float"}
    words = {"scenario": "name in the catalogue of flexaxis", "seed": "number of the run"} | SIGNALS
    for name in samples.columns:
        of = name.removeprefix("true_")
        yield {
            "@type": "cr:Field",
            "@id": f"samples/{name}",
            "name": name,
            "description": words.get(name) or f"true {of} in this sample [{UNITS.get(of, '')}]",
            "dataType": kinds.get(samples[name].dtype.kind, "sc:Text"),
            "source": {"fileObject": {"@id": NAME}, "extract": {"column": name}},
        }


def described(suite: str, seeds: range, samples: pd.DataFrame, folder: Path) -> dict[str, Any]:
    """Return the metadata of the folder."""
    content = (folder / NAME).read_bytes()
    return {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": f"flexaxis-{suite}",
        "description": f"Simulated runs of the scenarios of {suite}, seeds {seeds.start} to "
        f"{seeds.stop - 1}: torque and motion of a geared, flexible robot axis in which a "
        "parameter changes, with the true parameters in every sample.",
        "license": "https://www.apache.org/licenses/LICENSE-2.0",
        "citeAs": "flexaxis: a benchmark for recursive identification of a geared, flexible robot "
        "axis (CITATION.cff)",
        "version": version("flexaxis"),
        "datePublished": datetime.now(UTC).date().isoformat(),
        "distribution": [
            {
                "@type": "cr:FileObject",
                "@id": NAME,
                "name": NAME,
                "contentUrl": NAME,
                "encodingFormat": "application/x-parquet",
                "sha256": hashlib.sha256(content).hexdigest(),
            },
            {
                "@type": "cr:FileSet",
                "@id": "records",
                "name": "records",
                "description": "the same runs, with scenario and units in each file",
                "encodingFormat": "application/x-netcdf",
                "includes": "records/*.nc",
            },
        ],
        "recordSet": [
            {
                "@type": "cr:RecordSet",
                "@id": "samples",
                "name": "samples",
                "field": list(fields(samples)),
            }
        ],
    }


def write(suite: str, seeds: range, folder: Path) -> None:
    """Write the data set into a folder."""
    (folder / "records").mkdir(parents=True, exist_ok=True)
    scenarios, parts = select([suite]).scenarios, []
    with progress("simulating", len(scenarios)) as advance:
        for scenario in scenarios:
            for record in simulate(scenario, list(seeds)):
                record.save(folder / "records" / f"{scenario.name}-{record.seed}.nc")
                parts.append(frame(record))
            advance(1)
    samples = pd.concat(parts, ignore_index=True)
    samples.to_parquet(folder / NAME, index=False)
    text = json.dumps(described(suite, seeds, samples, folder), indent=1, ensure_ascii=False)
    (folder / "croissant.json").write_text(text + "\n", encoding="utf-8")


def main(words: list[str] | None = None) -> None:
    """Write what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("suite", nargs="?", default="board-v1")
    parser.add_argument("--seeds", default="1000:1005", metavar="A:B")
    parser.add_argument("-o", "--output", type=Path)
    given = parser.parse_args(words)
    first, last = map(int, given.seeds.split(":"))
    folder = given.output or ROOT / "results" / given.suite
    write(given.suite, range(first, last), folder)
    print(folder)


if __name__ == "__main__":
    main()
