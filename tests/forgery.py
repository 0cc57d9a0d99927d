"""Bundles whose scores somebody has changed."""

import json
from hashlib import sha256
from zipfile import ZipFile


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
