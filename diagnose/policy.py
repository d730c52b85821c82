"""Every number that decides in a diagnosis, by what it decides, with its reason."""

from __future__ import annotations

import math

import numpy as np

# What counts, as a drop of BIC or of -2 log likelihood.
THRESHOLD = 28.0  # drop of BIC below which nothing is said; bench/diagnose/nulls.py measures the rate of false alarms
COLORED_THRESHOLD = 60.0  # drop of BIC below which nothing is said where there is a slow disturbance
SLOW_THRESHOLD = 80.0  # and there for effects that look like one
UNLIKE_NOISE = 300.0  # of an effect that leads simulations further off: nulls.py lets 1 of 100 bring more than 60
STEPPED_LIMIT_THRESHOLD = 500.0  # for a limit of a sensor of coarse steps: the last of them looks like one
SEARCHED_PRICE = 8.0  # more where a parameter was searched over dozens of values: twice the logarithm of how many
TIE = 10.0  # explanations closer than this in BIC are not told apart
RICHER_PRICE = 25.0  # what a richer effect must win over the simpler one that it contains
CLEAR_GAIN = 150.0  # a short fit this far behind cannot catch up, or this far ahead has clearly gained
CHANCE_GAIN = 500.0  # the most that a load by chance may bring
SHAPE_GAIN = 70.0  # drop of BIC by a nameless shape, from which it counts as a mismatch
SLOW_SHAPE_GAIN = 100.0  # the same where a disturbance is slow in every output
LEFT_GAIN = 60.0  # drop of BIC by a shape, from which an explanation is not the whole of it
LITTLE_GAIN = 150.0  # drop of BIC up to which a name says little
PATCHED_GAIN = 300.0  # what an effect may owe to kinks
HOLD_GAIN = 60.0  # drop of -2 log likelihood from which a hold is believed; a controller's output is held, as a rule
USUAL_WITHIN = 5.0  # usual values of a richer effect may be less likely by this, below the noise, and still be the case
LEVELLED_WITHIN = 3.0 * TIE  # from the best: candidates that are polished as that was
NUDGE_GAIN = 2.0  # evidence that a nudge has to bring
PROFILE_GAIN = 0.5  # decrease of the cost that is worth fitting again from there
IMPOSSIBLE = 1e9  # the score of what cannot be

# What counts, as a share of what is explained.
MINOR_SHARE = 0.015  # of what the others explain: less may be the trace of how a model simplifies them
TRACE_SHARE = 0.05  # what an effect may owe to kinks, of all that is explained
SHAPE_SHARE = 0.25  # of what the named effects explained: more left than this is not explained
LINEAR_SHARE = 0.5  # of the size it was simulated with, below which a term is looked at again as large as it seems
OPPOSITE_SIZE = 0.1  # of a size that leads away from what is missed: a swing that friction ends tells of none
PROMISED_SHARE = 0.08  # of the best screened drop: less is not tried in a round
EXHAUSTIVE_SHARE = 0.25  # of what the best explains, that a trial has to explain after a few steps
HOPELESS_SHARE = 0.25  # of the drop that all effects have brought, behind which a trial after a few steps is left
EXCHANGED_SHARE = 0.1  # of that drop, that may be missing where two effects are the same for all that is known of them

# What counts, as a ratio of residuals.
SAME_RMS = 1.01  # closer ones differ by chance: 1 / sqrt(2 n) of an rms of 5,000 independent rows is 1 %
WIDER_RMS = 1.1  # ratio of residual rms from which an explanation is none
CLOSER_RMS = 0.7  # ratio of residual rms, from which an effect is no trace of others
HELD_SHARE = 0.05  # of what the nominal plant misses of unseen recordings: what leaves no more of that does hold there
UNSEEN = 1e-280  # squared trace of a coordinate that leaves none
ABSURD_COST = 1e3  # ratio of costs from which initial states are none
MISFIT_SAMPLES = 0.5 * THRESHOLD / math.log(1.0 / CLOSER_RMS)  # that a misfit counts as: such a fall is worth THRESHOLD
FAINT_SHARE = 5e-7  # of what an output moves, rms: what simulations by other steps differ by
RMS_BY_CHANCE = 2.0  # deviations of an rms, by which it may be larger where a few slow swings are all it is made of
NEEDED_RMS = 1.5  # ratio of residual rms, from which an effect is needed whatever innovations say
NOISE_GAIN = 0.02  # of the rms of what is left, by which a fit goes on that takes all noise as white
SLOW_RMS = 4.0  # residual rms over innovation rms from which a misfit may be slow
ROUNDING = 3.0  # times the least noise of a sensor's resolution: the rms of what its steps round off
SLOW_NOISE = 0.05  # of an output's spread, rms: more than that is no noise, however slowly it moves
NEARER_RMS = 0.9  # ratio of residual rms from which simulations come nearer
STANDSTILL = 0.2  # of the rms of a speed: below it dry friction may be what it has to be
LOST_SHARE = 0.5  # of an output's spread: a misfit with which a simulation follows nothing
SHOWN_RMS = 2.0**0.5  # ratio of residual rms before and after, from which an effect is as large as the noise
FAILED_RMS = (
    20.0  # times the residual of train, or its noise, on unseen recordings: nothing that was fitted holds there
)
HOLD_RMS = 0.98  # ratio of residual rms that another hold has to bring

# Slow disturbances: what they may do, and how it is told from a load.
LONG_MEMORY = 6  # order of a noise model from which a disturbance is slow
NEVER_BY_CHANCE = 8.0  # deviations by batches, more than which no slow disturbance has
LOAD_BY_CHANCE = 3.0  # deviations of an average, less than which a slow disturbance has by chance
PULL_BY_CHANCE = 5.0  # the same of what pulls by where it is
BATCHES = 12  # of each recording, over which a load is averaged
WITHIN_BATCHES = 0.3  # of what an effect does, that its loads by batches may leave
SLOW_WAVE_PERIODS = 4.0  # in the whole way, below which a wave is as slow as a disturbance
PUSHED_BATCHES = 50  # of each recording: a disturbance between two of them is moved by either
CERTAIN_SIZE = 2.5  # deviations of an effect's size from none, from which it is certain
CERTAIN_STEP = 4.0  # the same of one whose moment was searched for
ROUNDED_MOVE = 1e-6  # of the longest move: less is rounding
KNOWN_BEFOREHAND = 0.5  # of what is told of a combination, from which it was known beforehand
PUSH_SHARE = 0.002  # of the largest effort: what bodies that meet make of more is not of first order

# Parameters: as given, as fitted, and how well they are known.
ON_BOUND = 1e-3  # share of a finite upper end of a range within which a fit ended on the bound and not in the data
SAME_CONSTANT = 0.3  # of log(kt / ke) as given, up to which both are meant to be one constant, as they are in SI units
KNOWN_BY_FACTOR = 23.0  # reach of log(size) beyond which nothing is known of it: 10^10 times less or more
CONSTANT_DEVIATION = 0.02  # standard deviation of log(kt / ke) where they are one
CONSTANT_WEIGHT = 30.0  # weight of their ratio beside the parameters' own shifts
GIVEN_DEVIATION = 1.0  # of a nominal parameter as given, as a logarithm: it counts where data are silent
FARTHEST_TORQUE_SCALE = math.log(4.0)  # as a logarithm
LEAST_INERTIA = 0.1  # of the nominal inertia, which stays where a load is split off
MOVED_FAR = 0.15  # as a logarithm: a parameter is far from where it was given
FIRM_TO_RUN_AWAY = 0.05  # as one deviation of the logarithm: it is well determined there
RUN_AWAY = 1.5  # factor on a nominal parameter that has run away
LOST_PARAMETER = 6.0  # factor on one so far away that what hides behind it does not show beside what was found
FIRM_TO_SAY = 0.1  # of a parameter, as one deviation: it is well determined
GIVEN_WITHIN = math.log(1.25)  # as a logarithm: by how much a value that a project holds may be off, as data sheets are
HARDLY_MEANT = 3.0  # factor on a nominal parameter from which its value was hardly meant
FAR_START = 6.0  # factor on a parameter that is far off
LARGEST_SIZE = 0.999  # of the largest possible size, from which an effect had to be that large
CHI_SQUARED_95 = 3.841458820694124  # 95 % of chi-squared with one degree of freedom
PROFILE_REACHES = (2.0, 4.0, 8.0, 16.0)  # deviations at which a profile is tried
PROFILE_SCAN = np.arange(-40.0, 41.0, 2.0)  # deviations within which a moment may have a better place
PROFILE_TURNS = 3  # of a profile that finds a better place
AT_REST = 3.0  # deviations of a beginning from rest, up to which a machine rests
IN_MOTION = 5.0  # and from which it moves

# Probabilities and notes of a verdict.
SOFT_EVIDENCE = 4.0  # evidence is halved twice before it becomes a probability: noise models are never quite right
COUNTED_SAMPLES = 1.05  # scale over rms of a noise from which independent samples were counted: chance leaves some, too
EVEN_CHANCE = 0.674  # deviations from nothing, within which an effect is as likely none
HINT_OF_CHANCE = 0.999  # of chance, which a richer explanation has to beat to stand beside the best, below the noise
WHITENESS_LAGS = 20  # over which whiteness is judged

# Steps of a fit.
STEPS_OF_A_TRIAL = 2  # of a trial that only has to promise something
STEPS_OF_A_START = 4  # of one start of several, the best of which is gone on with: after two it may be another
STEPS_OF_A_FIT = 24  # of a final fit
STEPS_OF_A_LAST_FIT = 4  # of one that only follows a new noise model
REFITS = 3  # by plain simulation error, each with the sizes that the last one left: they stay after two or three
STEPS_OF_A_NEAR_FIT = 12  # of a fit that begins near its end
STEPS_BESIDE_USUAL = 8  # beside what is held at usual values
STEPS_FROM_GIVEN = 6  # beside parameters as given, or beside readings with their sign
STEPS_OF_A_NOMINAL_FIT = 12  # of the nominal plant by itself
STEPS_OF_A_READ_FIT = 16  # of one that parameters are read off
LAST_STEPS = 4  # at the very end of a fit
LAST_GAIN = 1e-3  # that the last of them gains
SETTLED_START = 0.01  # of the cost: an initial state is there where a step changes no more

# Descent: damping, corrections and where it ends.
DIVERGED_RESIDUAL = 1e9  # times the noise: what a diverged simulation counts, more than any other
LEAST_RELATIVE_DECREASE = 5e-5  # relative decrease of the cost that is no longer worth a step
LEAST_DECREASE = 0.02  # decrease of the cost, in units of the noise, that is no longer worth a step
FIRST_DAMPING = 1e-3  # in units of each coordinate's own information
LEAST_DAMPING = 1e-10  # the same, at the least
UNDAMPED = 1e-8  # damping that holds no valley back
DAMPINGS = 6  # of a step
REFUSED_DAMPING = 8.0  # times as much after a step that leads up
KEPT_DAMPING = 6.0  # times as little after one that has kept its promise, which no step does better
BROKEN_DAMPING = 2.0  # times as much after one that has not, at the most (Nielsen, IMM-REP-1999-05)
LITTLE_DAMPING = 1e3  # times as little where a step promises or gains little
FEW_DAMPINGS = 2  # and after one that gained little
EXACT_STEPS = 8  # of a fit that is taken to its end
HELD_DAMPING = 0.02  # damping that holds a valley back, from which slopes for initial states have to be exact
CORRECTIONS = 8  # of a step
KEPT_PROMISE = 0.6  # share of its promise that a step has to keep, for its slopes to serve for the next one
CORRECTED_SHARE = 0.5  # share of what a step costs too much, that a correction may leave
LONGEST_STEP = 3.0  # change of a coordinate by one step
KEPT_SLOPES = 16  # sets of slopes for initial states
COARSE_CHANGE = 2.0  # as longest change: ten times as fast as the usual, and alters an effect's trace by about 1/1000
DIFFERENCE_STEP = 1e-5  # of a coordinate, for difference quotients
FINE_DIFFERENCE_STEP = 1e-8  # the same where waves follow the simulated angle, which it takes far after many turns
ACROSS_KINKS = 100.0  # times these steps, up to the next: they take in either side of a kink
ROUGH_DIFFERENCE_STEP = 3e-3  # the same where bodies meet: each time a moment later, outputs move by a small leap

# Budgets, in million steps of simulation; one in which all but the input is linear counts half.
SEARCH_PATIENCE = 80.0  # after which no further effect is looked for
COMPLETION_PATIENCE = 30.0  # after which nothing further is looked for
EXCHANGE_PATIENCE = 15.0  # after which nothing further is put in another's place
EXCHANGE_TRIAL_PATIENCE = 2.0  # of one such trial, after which no further step is made
ROUND_PATIENCE = 15.0  # after which a round tries no further term
INSISTING_PATIENCE = 8.0  # for what had promised much and gained nothing
EXHAUSTIVE_PATIENCE = 12.0  # after which no further term is tried
SCREEN_PATIENCE = 4.0  # for one term: stiff corners of some effects simulate very slowly
FIT_PATIENCE = 10.0  # for one fit, for the same reason
CONTACT_FIT_PATIENCE = 20.0  # for moving contacts past their kinks
GROWTH_PATIENCE = 10.0  # after which no stretch begins to grow

# How many are tried, and how often.
MOST_EFFECTS = 4  # in one explanation
WORTH_A_REFIT = 12.0  # screened drop of the whitened sum of squares from which a refit is worth its time
LEVELLED = 3  # candidates near the best that are polished as that was
EXCHANGES = 3  # times that what is mistaken for an effect is put in its place
EXCHANGE_STARTS = 3  # from which one effect is tried in the place of another
EXHAUSTIVE_FINALS = 3  # terms fitted to the end, of those tried from all their starts
LEADS = 3  # of a regression, with as many terms each
TRIED_FROM_GIVEN = 3  # terms tried beside the parameters as given
ANGLE_AMENDMENTS = 8  # that the angle is amended, each by the last fit, as long as that explains more
PIECES = 8  # of a recording
ROWS_OF_A_PIECE = 200  # at the least
HIGHEST_ORDER = 48  # waves per turn
SLOW_SHARE = 0.1  # of the rows, the slowest, in which a wave has to take more than two rows
KEPT_ORDERS = 2  # best orders or moments by each noise model, that are screened
MOMENTS_TRIED = 60  # over a recording
ORDERS_AT_ONCE = 8  # choices that are pushed through the plant together
TRIED_IN_A_ROUND = 9  # terms refitted per round, besides relatives
FINALS_OF_A_ROUND = 4  # of them refitted to the end
PROMISED_IN_A_ROUND = 3  # more of them, where no trial gains
CONTACT_STARTS = 3  # starts from which a contact is followed further
HALVINGS = 4  # of the size of an effect at its start
SMALL_GRID = 8  # starts of a grid that are all followed
PARALLEL = 1e-5  # of a direction's length: what is left of less cannot be told from a nominal change
COUNTING_ROUNDS = 6  # of counting turns, each by a fit to what the last has counted
KINK_SOLVES = 30  # past kinks, of a few steps each, beside the best explanation
CURVED_VALLEYS = 4  # times that a fit goes on which a curved valley had held a deviation from its end
TRIED_SHAPES = 3  # weighed in full beside named effects, of each noise model's order
SHAPE_ROUNDS = 2  # of fitting a shape with the noise that the last fit left over

# Contacts and limits: nudges past their kinks.
CONTACT_NUDGES = (  # factors on where a contact is, how stiff, and how damped: as much of critical as it was
    (1.0, 1.0, 1.0),
    (1.02, 1.0, 1.0),
    (0.98, 1.0, 1.0),
    (1.1, 1.0, 1.0),
    (0.9, 1.0, 1.0),
    (1.0, 0.5, math.sqrt(0.5)),
    (1.0, 2.0, math.sqrt(2.0)),
)
CONTACT_STRETCHES = (0.05, 0.1, 0.2, 0.35, 0.55, 0.75)  # of the rows that a fit grows over before it takes all
BRIEF_CONTACT = 0.2  # of the rows: fewer do not tell how stiff and how damped a contact is
HARDER_CONTACTS = (1.0, 3.0, 10.0)  # factors on how stiff contacts are, where a stretch begins to grow
STEPS_PAST_KINKS = 60  # from one start
STEPS_AT_ONCE = 4  # of one solve
LEAST_KINK_DECREASE = 1e-5  # of the cost, by which a few steps have to lower it: of 10,000 rows a tenth of a unit
LIMIT_NUDGES = (0.97, 1.03, 0.9, 1.1)  # factors on a limit, from which the fit starts again
LONGER = 10.0  # times the steps of a simulation where a step of a fit begins: one of more counts as diverged
MOST_KINK_SOLVES = 100  # solves of a few steps each

# What has no name: the shapes it may have.
WORST_SPANS = 3  # of a recording that a finding names
FEW_ROWS = 0.01  # of all: readings that failed are rarely more, as `identify` has it
MOST_OF_IT = 0.5  # of the squares of what is missed, from which a finding says that a few rows hold it
SHORTEST_SPAN_S = 0.05  # s; spans shorter than that are not told apart
MOST_SMOOTHED_ROWS = 20_000  # a longer recording is smoothed up to here
MOST_WEIGHED_ROWS = 4000  # of all recordings, by which it is weighed how quickly disturbances move
QUICK_WALK = 0.3  # of the noise, that a step of a disturbance does to an output: it shows within a few rows
WALKS = tuple(float(walk) for walk in np.geomspace(1.0, 1e-9, 13))  # the same; a position adds all up twice
COLORED_SENSOR = 10.0  # times a sensor's white noise; 28 fresh nulls leave at most 6.8 times that
MOST_DIGITS = 9  # of a value that is printed beside its interval
MOST_TIMES = 1000.0  # its value, to which a refit moves a parameter: further says no more by its figure
CONTROLLER_ROWS = 10  # later than a reading, in which a controller has answered it
CONTROLLER_BY_CHANCE = 5.0  # deviations of a correlation of noise: one of ten rows and a few outputs is never so large
HELD_INPUT = 0.5  # share of rows in which an input stands still, above which no controller makes it
RIVALS_DRIVE = 0.5  # of the drive's rms, from which a disturbance is no noise
MOTION_MISSED = 0.05  # of what an output moves: noise of a sensor is rarely more
STILL_MISSING = 1.2  # residual over sensor noise, from which it is said how much is missing: estimates differ by less
LIVE_COLUMN = 1e-4  # of a column, which the base's own unknowns cannot imitate
DETERMINED_SHAPE = 1e-3  # least singular value of what a fit may move, of the largest
HATS = 10  # over the values of a coordinate
HARMONICS = 4  # of a turn
SPRING_MEMORIES_S = (0.003, 0.01, 0.03, 0.1, 0.3)  # after which a stretched spring yields (at usual speed) or relaxes
WARM_SHARES = (0.03, 0.1, 0.3, 1.0)  # of the longest recording, after which what has become warm is cool again
TELLING_DRIVE = 0.3  # of its largest: what a smaller drive loses tells of none that fails
RARE_DEVIATIONS = 9.0  # median deviations from what is usual: of 1e9 rows of noise one is further
LINES_PER_CYCLE = 4  # lines of a spectrum per cycle in a recording
NEIGHBOUR_CYCLES = 40  # cycles in a recording that a line is held against
ROWS_OF_A_CYCLE = 4  # at the least: a line of fewer may be the mirror image of any that is quicker
DRIFT_CYCLES = 5  # in a recording: a slower wave is a drift
MAINS_HZ = (50.0, 60.0, 100.0, 120.0)  # hum, and what rectifiers make of it
GRID_HZ = 0.2  # by which a grid may be off: EN 50160 asks for less than 0.5
FAR_TO_ONE_SIDE = 0.1  # of the rows, and of the way to the other side, that are far to one side

# Noise of the sensors: the flat upper end of a spectrum.
SENSOR_BANDS = 16  # of frequency, at the most
SENSOR_BAND_BINS = 12  # of a spectrum, that a band needs
FLAT_BY_CHANCE = 2.6  # deviations by which two parts of a flat spectrum differ; 1 % exceed that
MEDIAN_POWER = math.log(2.0)  # of a flat spectrum's powers, whose mean is 1
HANN_BINS = 35.0 / 18.0  # that count as one under a Hann taper: the sum of their squared correlations
LEAST_NOISE = 1e-30  # in the output's unit: that of nothing at all
LINE_POWER = 12.0  # times the power beside it: a line; of flat noise exp(-12) exceed that

# Evidence: how often chance would say as much, and what was left out of a fit.
CHANCE_DRAWS = 1999  # of the noise: the least chance that is told is 1 in 2000
CHANCE_PATIENCE = 20.0  # million steps of simulation for the traces of all terms, after which no further one is counted
MOST_DIRECTION_VALUES = 20_000_000  # of the traces of all terms together: more would take over half a gigabyte
SLOWEST_BINS = 6  # of a spectrum, the slowest, that are averaged: each alone is all chance
DETERMINED_DIRECTION = 1e-8  # least power of a combination of traces, of the largest
CROSS_FOLDS = 3  # parts that are left out in turn
CROSS_PATIENCE = 20.0  # million steps of simulation, after which no further part is left out
CROSS_FIT_PATIENCE = 3.0  # of one fit to the rest

# Recordings: what is refused, and what is cut.
FEWEST_ROWS = 60  # of all train recordings, of a block left out, or without a missing one: fewer tell nothing
CLOCK_JUMP_ROWS = 50.0  # rows; a gap longer than this is no jitter
SIGNLESS_NOISE = 0.03  # of the largest reading: noise of one that has no sign
MISLABELLED_CORRELATION = 0.85  # correlation from which a column is taken to follow the simulation of another
DEAD_SHARE = 0.2  # share of rows from which a value that stands still is a dead sensor
MOTION_MEANWHILE = 0.5  # of the plant's whole motion, that the nominal plant must make meanwhile
COPIED_ROWS = 60  # in a row that two recordings share only where one is the other
COPIED_VALUES = 10  # different values that those must hold
TRIAL_ROWS = 2000  # of a recording, on which a nominal fit is tried
CLOSE_POWER = 0.01  # of the outputs' power: where a fit leaves less, no other start is tried
MET_POWER = 0.1  # of the outputs' power may be left where a fit tells what the parameters are
CLOCK_GAP_STEPS = 3.0  # usual steps from which a gap between rows may be a jump of the clock
USUAL_GAPS = 0.98  # of all gaps between rows; longer ones are not the logger's usual steps
CLOSED_GAP_POWER = 0.8  # of the power that is left with the gap, if the motion knows nothing of it
APART_POWER = 5.0  # times the power that separate fits leave, from which recordings are of different machines
OTHER_MACHINE = 1.3  # and factor between their parameters
UNSEEN_COMBINATION = 1e-6  # of the largest singular value of the slopes: a combination without a trace
MOST_ROWS = 30_000  # straight pieces of input over all recordings of one role
NONLINEAR_ROW_COST = 8  # times as long takes a row of a plant whose equations are not linear
STRETCH_PLACES = 8  # where a stretch of a long recording may begin
HOLD_TRACE = (0.5, 2.0)  # share of a hold's trace that is found in the residual, from which it is worth fits of its own
HOLD_HALVES = 1.15  # ratio of that share in the first and second halves of the recordings

# Readings in coarse steps, without their sign, or that wrap around.
COARSE_STEP = 1.0 / 512.0  # of the range: finer steps are what any sensor has
COARSE_ANGLE_RAD = 2.0 * np.pi / 200.0  # rad: no encoder has fewer steps a turn unless it is a coarse one
STEPS_ALONE = 0.45  # residual rms over step up to which the steps, and not noise, are what is left
EVEN_STEPS = 1e-3  # of a step, by which a multiple may be off
SIGN_ROUNDS = 3  # of giving signs, each by a fit to what the last has given
SIGN_BEND = 3.0  # usual changes of slope: what a row with a bend may cost
SIGN_AWAY = 0.03  # of the largest reading: what a row may be away from where it is expected
SIGN_MOST = 30.0  # usual changes of slope, more than which count no more
FEWEST_LEVELS = 8  # of all readings: where there are fewer, they leap by the steps of a coarse sensor
RANGE_REFINED = 3  # times a range is refined
RANGE_DEVIATIONS = 3.0  # of a range, further from which no fit of it is believed, or from which it was off
WHOLE_RANGE = 0.97  # of what is seen of a range, less than which none is
MOST_TURNS_OFF = 8  # that a reading may be off
LEAP_EITHER_WAY = 0.1  # ranges from row to row, from which a reading may as well have gone the other way round
LEAP = 0.5  # ranges of a leap
LASTING_LEAP = 1.5  # ranges of a row away from the plant
FARTHEST_LEAP = 2.0  # ranges, the most that counts
FEWEST_LEAPS = 10  # by half a range or more, that tell of it
LEAP_GAINS = np.arange(0.8, 1.21, 0.05)  # of the plant's leaps
SEEN_SHARES = np.arange(0.9, 1.01, 0.02)  # of a range that is seen
MET_LEAPS = 0.08  # of the range, by which leaps differ from the plant's (rms); chance leaves 0.29
RIM = 0.05  # of what is seen, so near its ends
AT_RIM = 0.3  # share of readings there: more is a limit
TELLING_WRAP = 0.35  # of the residual without wraps
RANGE_NEAR_SPAN = 0.2  # of the range, by which the readings' span and their jumps may differ
RANGE_DIFFERENCE_STEP = 1e-4  # of a parameter's logarithm, for difference quotients
RANGE_BATCHES = 12  # of all rows: what is left may be slow, and sums over them tell by how much it moves a range
COUNTED_NEAR = 0.25  # of a range: so near an explanation is, that can count their turns
COUNTED_MOST = 0.9  # of all readings that it has to be so near

# Controllers: what a replay is held to.
MOST_LATE_SAMPLES = 8  # that a controller may answer late
LIMITED_ROWS = 5  # rows at its extreme from which a command is taken to be limited there
NO_LIMIT = 1e3  # times the range of the output: as if there were no limit
ROUNDING_LANES = 6  # replays with other roundings of the recorded digits
REPLAY_TURNS = 10  # of fitting figures to a replay
REPLAY_TRIALS = 5  # of a step, each shorter
FARTHEST_FIGURE = 10.0  # sizes that a figure may move in one step
FINEST_FIGURE = 1e-6  # of a figure: no deviation is smaller, for firmware keeps its figures in single precision
LEAST_DIFFERENCE = 1e-7  # of the output's range: no difference is smaller, for the same reason
FIGURE_NUDGE = 1e-4  # of a figure, for difference quotients
LEAST_MISFIT_DECREASE = 1e-3  # relative decrease of the misfit that is no longer worth a step
DETERMINED_FIGURE = 1e-10  # least singular value of what the rows tell, of the largest
FEWEST_COUNTED_ROWS = 20  # rows that must count
MOST_REPLAYED_ROWS = 8000  # a longer recording is replayed up to here
MOST_STRIDE = 40  # rows from one change of a command to the next
HELD_COMMAND = 0.98  # share of the changes of a command that must fall on its steps
MOST_LEVELS = 30  # different values up to which a column holds levels
FEWEST_CONVERTER_STEPS = 8  # of a converter, to be told from levels that somebody chose
UNEVEN_STEP = 0.05  # of a converter's step, by which its values may be off it: they are written with few digits
COUNTED_DIGITS = 400  # values whose digits are counted
AGREES = 3.0  # misfit up to which a replay is that of the recording
PERIOD_SHARE = 0.02  # share by which the rows may be off the controller's period
DECISIVE_SHARE = 0.05  # of the mismatch's power: more left than this is not explained
FINAL_FAULTS = 6  # faults that are fitted with the unknown first state
FAULTS_BESIDE = 5  # kinds of those without a figure, tried together with all gains
FIRST_TURNS = 4  # after which a fault must promise something
PROMISING_SHARE = 0.1  # of the mismatch: what those few must reach
SIGNIFICANT_GAIN = 4.0  # deviations by which a gain must be off
TRIFLING_GAIN = 1e-3  # of a gain: less is rounding
SAME_MISFIT = 1.15  # ratio of misfits within which two faults are not told apart
OTHER_CONTROLLER = 0.5  # of the command's spread: more mismatch than this is another controller's
COMMAND_NOISE = 0.05  # of the command's spread: less mismatch than this may be noise, if it is not correlated
COMMAND_CORRELATION = 0.5  # correlation of neighbours up to which it is not
OTHER_GAINS = 2  # more gains than that are not faults of the firmware, but of another one
TIED_FAULT = 0.5  # probability of a fault that another explains as well
SURE_FAULT = 0.99  # probability of a fault that nothing else explains
