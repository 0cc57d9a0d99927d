"""The folder of a request that may be interrupted: the same request may use it again, and no other."""

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vobench.dataset.picture import require_free
from vobench.errors import InputError

REQUEST_FILE = "request.json"


def claim(out: Path, request: Mapping[str, Any], *, regenerated: tuple[str, ...] = ()) -> None:
    """Use a folder for a request, which is new, empty, or was left by the same request when it was interrupted.

    `request` are the values, as JSON has them, that determine the results. They are written to the folder.
    `regenerated` are the names of folders in it that the request fills again. They are removed first.

    Raises InputError if the folder contains anything else.
    """
    file = out / REQUEST_FILE
    text = json.dumps(dict(request), indent=1, ensure_ascii=False) + "\n"
    if not file.is_file():
        require_free(out)
        out.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
        return
    if file.read_text(encoding="utf-8") != text:
        raise InputError(f"is in use for another request, which is in {REQUEST_FILE}; name a new folder: {out}")
    for name in regenerated:
        shutil.rmtree(out / name, ignore_errors=True)
