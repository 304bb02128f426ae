"""Tables of the event-driven solver: rows and columns of the arrays that its kernels share.

Rows are named by constants, not by fields of a named tuple of views, which would take longer to compile.
"""
