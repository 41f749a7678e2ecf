"""What the commands print at their end."""


def stage_table(groups):
    """{group: {stage: milliseconds}} as text, a group's sum first; stages below a tenth of a percent of everything are left out."""
    total = sum(sum(stages.values()) for stages in groups.values())
    lines = [f"{'stage':32}{'time':>12}"]
    for group, stages in groups.items():
        lines.append(f"{group:32}{sum(stages.values()):>9.1f} ms")
        lines += [f"  {name:30}{time:>9.1f} ms" for name, time in stages.items() if time >= 0.001 * total]
    return "\n".join(lines)
