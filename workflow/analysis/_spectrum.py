"""Amplitude spectra of what an archive records over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import xarray as xr


def spectrum(values: xr.DataArray, last: float = 0.5) -> xr.DataArray:
    """Return the amplitude spectrum of the last part of a history, its mean taken off.

    The samples x_k of the last part are weighed by Hann's window w_k: A(f) = 2 |Σ w_k (x_k - mean) exp(-2πi f t_k)| /
    Σ w_k, which is the amplitude of a sinusoid at its own frequency. Two of them are told apart where their frequencies
    differ by twice the distance of the frequencies given, the width of the window's main lobe at half its height.

    Parameters
    ----------
    values
        A history of an archive or of some of its cases, with the dimension ``t``.
    last
        Share of the samples, 0 < last <= 1.

    Returns
    -------
    xarray.DataArray
        In the unit of the history, with the dimension ``frequency`` [Hz] in the place of ``t``; NaN where a case is.

    Raises
    ------
    ValueError
        The array has no dimension ``t``, or fewer than four samples are left.
    """
    import xarray as xr

    if "t" not in values.dims:
        raise ValueError(f"`{values.name}` has no dimension `t`; a spectrum is that of a history")
    part = values.isel(t=slice(values.sizes["t"] - round(last * values.sizes["t"]), None))
    count = part.sizes["t"]
    if count < 4:
        raise ValueError(f"a spectrum of {count} samples says nothing; record more, or take a larger part of them")
    times = part["t"].values
    window = np.hanning(count + 1)[:-1]
    frequency = np.fft.rfftfreq(count, (times[-1] - times[0]) / (count - 1))
    deviation = (part - part.mean("t", skipna=False)).transpose(..., "t")
    amplitude = 2 * np.abs(np.fft.rfft(deviation.values * window)) / window.sum()
    dims = (*deviation.dims[:-1], "frequency")
    coords = {name: one for name, one in part.coords.items() if "t" not in one.dims}
    coords["frequency"] = xr.DataArray(frequency, dims="frequency", attrs={"units": "Hz", "long_name": "frequency"})
    about = {"units": str(values.attrs.get("units", "1")), "seconds": float(count * (times[1] - times[0]))}
    return xr.DataArray(amplitude, coords, dims, name=values.name, attrs=about)
