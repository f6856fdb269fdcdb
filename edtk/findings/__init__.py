"""What is said of a sheet, a plan or a study, and who finds it."""
