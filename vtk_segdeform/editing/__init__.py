"""What stands behind `session` and `store`: states, their history, painting, handles, poses."""
