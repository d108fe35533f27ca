"""OpenCL devices: drivers in processes of their own, how -d chooses, what each can and cannot do.

Only `opencl` here and `measure.runner` call OpenCL. What one driver does wrong is said here and
is worked around here; no other part may ask which driver it runs on.
"""
