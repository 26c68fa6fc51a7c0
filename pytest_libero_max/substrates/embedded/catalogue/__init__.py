"""The catalogues of source variations of the embedded scenes: LIBERO-Plus's 10,030 and LIBERO-PRO's 400."""
