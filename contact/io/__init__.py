"""The files of a run: tables, fields, checkpoints, and their folder."""
