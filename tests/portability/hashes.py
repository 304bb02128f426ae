"""Run studies in this process and write their content hashes: ``python hashes.py DIRECTORY [NAME | FILE]…``."""

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parent))

from portable_studies import STUDIES, write_coupled

from workflow.archive import provenance
from workflow.run import run_study
from workflow.study import parse_study, read_study


def main(directory: Path, names: list[str]) -> None:
    """Write ``hashes.json`` into the directory, beside the archives."""
    directory.mkdir(parents=True, exist_ok=True)
    write_coupled(directory / "coupled.npz")
    by_name = {}
    for name in names:
        text = STUDIES.get(name)
        study = read_study(Path(name)) if text is None else parse_study(f"study: {name}\n{text}", str(directory / name))
        archive = directory / f"{Path(name).stem}.nc"
        archive.unlink(missing_ok=True)
        run_study(study, archive, threads=1)
        by_name[Path(name).stem] = provenance(archive)["content_hash"]
    (directory / "hashes.json").write_text(json.dumps(by_name))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
