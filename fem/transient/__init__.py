"""Light in time: what follows a short pulse, and the moments of what detectors read of it.

contour    from values in the Laplace domain to values in time, with a guard
transient  `Transient`: readings and exitance in time
solve      one mesh, and solves with the shifts of contours on it
laplace    readings in the Laplace domain
moments    mean times, variances and higher moments
"""
