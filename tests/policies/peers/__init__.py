"""Published programs that the protocols come from, in processes of their own, and scripts that start them.

The scripts run in this Python, or in that of ``LIBERO_MAX_TEST_PEERS``, for packages that do not go with
ours.
"""
