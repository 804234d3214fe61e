# Shared by the scripts beside this file: numbered steps with their time, and failures that say why.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
step_count=0
step_started=0

# step TEXT: closes the step before with its time and announces the next.
step() {
  end_step
  step_count=$((step_count + 1))
  step_started=$SECONDS
  echo "==> [$(basename "$0") $step_count/$step_total] $1"
}

end_step() {
  if [ "$step_count" -gt 0 ]; then
    echo "    done in $((SECONDS - step_started)) s"
  fi
}

fail() {
  echo "$(basename "$0"): $1" >&2
  exit "${2:-1}"
}

# Compilers of this code take up to 1.5 GB each, so memory limits the jobs as well as the cores do.
job_count() {
  local cores memory_gb jobs
  cores=$(nproc)
  memory_gb=$(awk '/^MemAvailable:/ {print int($2 / 1048576)}' /proc/meminfo 2>/dev/null || true)
  jobs=$cores
  if [ -n "$memory_gb" ] && [ $((memory_gb * 2 / 3)) -lt "$jobs" ]; then
    jobs=$((memory_gb * 2 / 3))
  fi
  echo $((jobs < 1 ? 1 : jobs))
}
