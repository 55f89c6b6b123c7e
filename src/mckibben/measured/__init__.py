"""Every model on folders of recordings: fixed splits, one comparison a task, one page of all."""
