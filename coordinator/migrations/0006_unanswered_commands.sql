-- Nobody looks for commands without an answer.
DROP INDEX unanswered_commands;
