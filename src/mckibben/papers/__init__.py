"""The papers, one folder each: its protocol, what it prints, and its re-run, published beside ours."""
