"""A scheme that does not say that it takes several contacts."""

from workflow.schemes.carpenter import READS, Options, compute, init

__all__ = ["READS", "Options", "compute", "init"]
