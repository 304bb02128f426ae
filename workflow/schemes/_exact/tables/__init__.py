"""Tables of the exact solver: what lies in each row or column of the arrays that its kernels share.

Rows have names as constants, not as fields of a named tuple of their views: functions that pass 24 such views on take
1.5 times as long to compile (1.6 s against 1.1 s for eight of them), and run no faster.
"""
