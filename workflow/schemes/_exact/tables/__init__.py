"""Tables of the exact solver: what lies in each row or column of the arrays that its kernels share.

Rows have names as constants, not as fields of a named tuple of their views: functions that pass so many views on take
longer to compile.
"""
