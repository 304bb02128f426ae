"""Tables of the exact solver: what lies in each row or column of the arrays that its kernels share."""
