"""What a machine measured: bags read, repaired and counted, and bags made from other logs."""
