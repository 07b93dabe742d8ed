"""What could be wrong: each hypothesis changes one line of the scene, or how a signal is read.

`all_hypotheses` lists them: loads, orders and signs, scales, zeros of joints, and scales with the opposite
sign.
"""
