"""Bundles whose scores somebody has changed."""

import json
import warnings
from dataclasses import dataclass, field
from hashlib import sha256
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo


def forged(bundle, target):
    """The bundle with a perfect score for one estimator, and hashes that fit."""
    with ZipFile(bundle) as file:
        files = {name: file.read(name) for name in file.namelist()}
    name = next(name for name in files if "stand_still" in name and name.endswith("score.json"))
    score = json.loads(files[name])
    for metric in score["score"]["metrics"]:
        metric["rmse"] = 1e-9
    score["score"]["failure"]["lost_aware"] = 1.0
    files[name] = json.dumps(score).encode()
    hashes = json.loads(files["hashes.json"]) | {name: sha256(files[name]).hexdigest()}
    files["hashes.json"] = json.dumps(hashes).encode()
    with ZipFile(target, "w") as file:
        for name, content in files.items():
            file.writestr(name, content)


@dataclass(slots=True)
class Forger:
    """The files of a bundle that a forger changes, and what is appended to the zip file as it is."""

    files: dict[str, bytes]
    hashes_fit: bool = True
    appended: list[tuple[ZipInfo | str, bytes]] = field(default_factory=list)

    def edit(self, file, /, **changes):
        self.files[file] = json.dumps(json.loads(self.files[file]) | changes).encode()

    def write(self, path):
        if self.hashes_fit:
            hashes = json.loads(self.files["hashes.json"])
            names = [name for name in self.files if name in hashes or name.startswith("cases/")]
            fresh = {name: sha256(self.files[name]).hexdigest() for name in names}
            self.files["hashes.json"] = json.dumps(fresh).encode()
        with ZipFile(path, "w", ZIP_DEFLATED) as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a name that is there twice
            for name, content in [*self.files.items(), *self.appended]:
                file.writestr(name, content, ZIP_DEFLATED)


def forger_of(bundle):
    """The files of a bundle, to be changed."""
    with ZipFile(bundle) as file:
        return Forger({name: file.read(name) for name in file.namelist()})
