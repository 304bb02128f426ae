"""Archives whose errors are given."""

from typing import Any

import numpy as np
import xarray as xr

from workflow.analysis import ERRORS

H = np.logspace(-7, -3, 9)


def archive_of(error: Any, coords: dict[str, Any], **values: Any) -> xr.Dataset:
    """Return an archive with the same error in all histories; whatever is not given is ok, and known to 1e-13.

    Numbers and arrays are spread over the cases, which lie along the coordinates that are lists.
    """
    dims = [name for name, along in coords.items() if np.ndim(along)]
    shape = [len(coords[name]) for name in dims]
    of_cases = {**dict.fromkeys(ERRORS, error), "status": 0, "predictability": 1e-13, **values}
    of_cases["status"] = np.asarray(of_cases["status"], dtype=np.int8)
    data = {name: (dims, np.array(np.broadcast_to(value, shape))) for name, value in of_cases.items()}
    return xr.Dataset(data, coords, {"duration": 2.0})


def over_steps(
    errors: dict[str, np.ndarray], ok: dict[str, np.ndarray] | None = None, seconds: np.ndarray = 1e-8 / H
) -> xr.Dataset:
    """Return an archive of schemes over steps; every step is ok where nothing else is said."""
    error = np.array(list(errors.values()))
    return archive_of(
        error,
        {"scheme": list(errors), "h": H},
        status=[~(ok or {}).get(scheme, H > 0) for scheme in errors],
        max_penetration=1e-3 * error,
        energy_residual=-error,
        processor_time=seconds,
    )
