"""The paper's figures, made with this library: generators, a robot in MuJoCo, and other methods.

The paper is Matsubara, Hyon, Morimoto, Neural Networks 24 (2011).
"""

from pdmp.reproduction.run import FIGURES, reproduce

__all__ = ["FIGURES", "reproduce"]
