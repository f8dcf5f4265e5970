"""Other people's methods behind the command ``prog {maps} {out}``: programs of one file each, made to be copied."""
