"""What a person reads: tables, figures and the chapters of ``report.html``, from finished rows."""
