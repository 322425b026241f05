"""Is there structure in a residual, or only noise?"""
